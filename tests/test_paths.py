"""Every verb of the root face takes a path as a text: as a `Path` it gives the same files."""

import inspect
import zipfile
from dataclasses import fields
from pathlib import Path

import autophyx_tet as apx
import numpy as np
import pytest
import trimesh
from autophyx_tet.converters import PointTable, write_points
from autophyx_tet.fem import ElementMaterial, box_mesh
from autophyx_tet.toolkit.options import (
    AssignOptions,
    ConvertOptions,
    FeatureOptions,
    SimulateOptions,
    with_given,
)

CATALOGUE = "PluginFurnitureCatalog.properties"


def _verbs():
    """Functions of the root face that take or write a file, with their parameters of paths."""
    found = {}
    for name in apx.__all__:
        verb = getattr(apx, name)
        if callable(verb) and not isinstance(verb, type):
            given = inspect.signature(verb).parameters.values()
            paths = [one.name for one in given if "Path" in str(one.annotation)]
            found |= {name: paths} if paths else {}
    return found


def test_every_annotation_of_a_path_allows_a_text():
    for name in _verbs():
        for one in inspect.signature(getattr(apx, name)).parameters.values():
            said = str(one.annotation)
            assert "Path" not in said or "str" in said, f"{name}({one.name}: {said})"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A box, its mesh of jelly, points in it, a table of runs and of assets, an archive."""
    folder = tmp_path_factory.mktemp("files")
    trimesh.creation.box((0.1, 0.1, 0.2)).export(folder / "box.glb")
    mesh = box_mesh((0.1, 0.1, 0.2), (1, 1, 2))
    jelly = ElementMaterial.uniform(len(mesh.tets), E=1e5, nu=0.3, rho=500.0)
    apx.export(mesh.with_material(jelly), "gmsh", output=folder / "jelly.msh")
    inside = np.random.default_rng(0).uniform(0.01, 0.09, (20, 3)).astype(np.float32)
    write_points(folder / "points.ply", PointTable(dict(zip("xyz", inside.T, strict=True))))
    (folder / "runs.csv").write_text("load\n1\n2\n")
    (folder / "assets.csv").write_text("asset,text,mesher\nbox.glb,oak,stuffing\n")
    (folder / "run.toml").write_text("edge_length_rel = 0.3\n")
    with zipfile.ZipFile(folder / ("Scopia" + ".sh" + "3f"), "w") as archive:
        archive.writestr(CATALOGUE, "model#1=/a/a.obj\nname#1=a\ncategory#1=b\n"
                         "width#1=1\nheight#1=1\ndepth#1=1\n")  # fmt: skip
        archive.writestr("a/a.obj", "v 0 0 0\n")
    return folder


def _calls(place, folder):
    """Every verb with all its paths given as ``place`` makes them; files to write by name."""
    jelly, points = place("jelly.msh"), place("points.ply")
    coarse = {"mesher": "stuffing", "edge_length_rel": 0.3, "no_cache": True}
    quick = {"predictor": "retrieval", "cells": 8}
    panels = [apx.mesh_panel(box_mesh((1, 1, 1), (1, 1, 1)))]
    return {
        "convert": lambda: apx.convert(place("box.glb"), output=place("made.msh"), **coarse),
        "assign": lambda: apx.assign(
            place("made.msh"), "oak", asset=place("box.glb"), output=place("oak.msh"),
            field_output=place("oak.npz"), **quick,
        ),
        "segment": lambda: apx.segment(place("box.glb"), output=place("parts.glb")),
        "simulate": lambda: apx.simulate(
            jelly, output=place("moved"), drive=points, report=place("page.html"),
            picture=place("rest.png"), scenario="poke", poke_force=0.1, solver="lbs",
        ),
        "run": lambda: apx.run(
            place("box.glb"), ["oak"], output=place("run"), picture=place("run.png"),
            convert_options=apx.ConvertOptions(**coarse), assign_options=apx.AssignOptions(**quick),
        ),
        "reduce": lambda: apx.reduce(jelly, output=place("r.npz"), what_if=place("runs.csv")),
        "match": lambda: apx.match(
            jelly, place("moved/motion.pvd"), to_stiff=place("moved/motion.pvd"),
            output=place("p.npz"), scenario="poke", poke_force=0.1, solver="lbs",
        ),
        "transfer": lambda: apx.transfer(place("oak.npz"), points, output=place("oak.ply")),
        "export": lambda: apx.export(jelly, "calculix", output=place("jelly.inp")),
        "features": lambda: apx.features(
            place("box.glb"), output=place("f.npz"), picture=place("f.png"), views=2, cells=8,
            no_cache=True,
        ),
        "batch": lambda: apx.batch(
            place("assets.csv"), output=place("batch"), run_config=place("run.toml")
        ),
        "info": lambda: apx.info(jelly),
        "load_asset": lambda: apx.load_asset(place("box.glb")),
        "load_table": lambda: apx.load_table(place("table.csv")),
        "write_bonsai": lambda: apx.write_bonsai(place("bonsai.glb")),
        "render_png": lambda: apx.render_png(place("p.png"), panels, pixels=16),
        "render_animation": lambda: apx.render_animation(place("p.gif"), panels, pixels=16),
        "extract": lambda: apx.extract(apx.catalog("Scopia")[0], place("furniture")),
        # these two learn for minutes: what is wrong with the file is found after its path was taken
        "train": lambda: apx.train(
            place("none.toml"), data=place("data"), output=place("train"), start=place("w.npz")
        ),
        "evaluate": lambda: apx.evaluate(
            place("none"), data=place("data"), weights=place("w.npz"), memory=place("memory")
        ),
    }  # fmt: skip


WRITTEN = (
    "made.msh", "oak.msh", "oak.npz", "moved/motion.pvd", "page.html", "rest.png", "run/run.json",
    "run.png", "parts.glb", "r.npz", "r.what_if.csv", "p.npz", "oak.ply", "jelly.inp", "f.npz",
    "f.png", "batch/results.json", "bonsai.glb", "p.png", "furniture/a/a.obj",
)  # fmt: skip


def test_no_verb_is_forgotten(files):
    assert {*_calls(str, files)} == {*_verbs()}


@pytest.mark.long
def test_every_verb_takes_paths_as_texts(files, root, monkeypatch):
    """Relative ones, from the folder that they are in."""
    monkeypatch.chdir(files)
    monkeypatch.setenv("AUTOPHYX_SWEETHOME3D", str(files))
    calls = _calls(str, files)
    (files / "table.csv").write_bytes((root / "fem/data/materials.csv").read_bytes())
    for name in ("train", "evaluate"):
        with pytest.raises(apx.AutophyxError, match="none"):
            calls.pop(name)()
    for call in calls.values():
        call()
    assert [name for name in WRITTEN if not (files / name).is_file()] == []


def test_options_take_paths_as_texts():
    """What is given by name as a text is the `Path` that the command line makes of it."""
    for options in (ConvertOptions, AssignOptions, SimulateOptions, FeatureOptions):
        names = [item.name for item in fields(options) if "Path" in str(item.type)]
        assert names
        made = with_given(options(), dict.fromkeys(names, "a/b"), verb="a verb")
        assert [getattr(made, name) for name in names] == [Path("a/b")] * len(names)
