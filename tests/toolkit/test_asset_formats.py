"""What the formats of assets state themselves: unit, up axis, names; the rest is warned about."""

import re

import pytest
import trimesh
from autophyx_tet.converters.registry import Format, Keeps
from autophyx_tet.fem.errors import InputError
from autophyx_tet.toolkit.asset.foreign import CAD, FBX, SCENE
from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS, AssetContent, NamedSurface
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.asset.readers import CARRIER

from . import writers

PARTS = {"leg": (0, 0, 0), "seat": (3, 0, 0)}


def scene():
    """Two boxes by name."""
    made = trimesh.Scene()
    for name, place in PARTS.items():
        box = trimesh.creation.box((1, 1, 1))
        box.apply_translation(place)
        made.add_geometry(box, node_name=name, geom_name=name)
    return made


def _stl(made):
    """Text, a solid a part: binary STL has room for one."""
    solids = []
    for name in PARTS:
        text = trimesh.exchange.stl.export_stl_ascii(made.geometry[name])
        solids.append(re.sub(r"solid\s*$", f"solid {name}", text, flags=re.MULTILINE))
    return "\n".join(solids)


def _dae(made):
    """COLLADA, the made-up ids of its geometries replaced by the names of the parts."""
    text = trimesh.exchange.dae.export_collada([made.geometry[name] for name in PARTS]).decode()
    ids = re.findall(r'<geometry id="(\w+)"', text)
    for made_up, name in zip(ids, PARTS, strict=True):
        text = text.replace(made_up, name)
    return text


def _off(made):
    return trimesh.exchange.off.export_off(made.to_mesh())


def _xyz(made):
    """Points of a ball: a text cloud has no triangles."""
    points = trimesh.creation.icosphere(4).vertices
    return "\n".join("{} {} {}".format(*point) for point in points)


def _step(made):
    boxes = {name: made.geometry[name].bounds * 1000 for name in PARTS}  # mm
    return writers.step(boxes)


WRITERS = {".step": _step, ".stl": _stl, ".dae": _dae, ".off": _off, ".xyz": _xyz}


def _write(suffix, folder):
    """A file of the scene, or of points, in that format; of glTF the binary kind."""
    path = folder / f"thing{'.glb' if suffix == '.gltf' else suffix}"
    data = WRITERS.get(suffix, lambda made: made.export(file_type=path.suffix[1:]))(scene())
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


@pytest.mark.slow
def test_what_a_file_states_needs_no_option(tmp_path):
    """Unit and up axis are warned about where the format does not keep them, and only there."""
    forms = {ASSET_FORMATS[suffix]: suffix for suffix in ASSET_FORMATS}
    forms[CAD] = ".step"
    for form in (CARRIER, FBX, SCENE):  # nothing of a carrier is stated; of scenes: test_cases.py
        del forms[form]
    for form, suffix in forms.items():
        asset = load_asset(_write(suffix, tmp_path))
        said = " ".join(asset.warnings)
        assert ("the file has no unit" in said) == (Keeps.UNIT not in form.keeps), suffix
        assert ("which axis is up" in said) == (Keeps.UP not in form.keeps), suffix
        assert (set(asset.part_names) == set(PARTS)) == (Keeps.PARTS in form.keeps), suffix


def test_an_asset_format_is_registered_from_outside(tmp_path):
    """One object and one call: its files are loaded, and unknown when it is taken out again."""

    def read_cube(path, data, references):
        cube = trimesh.creation.box([float(data)] * 3)
        return AssetContent([NamedSurface(cube, ("cube",))], metres=1e-3)

    path = tmp_path / "a.cube"
    path.write_text("20")
    ASSET_FORMATS.register(".cube", Format("cube", (".cube",), read_cube, keeps={Keeps.UNIT}))
    try:
        asset = load_asset(path)
    finally:
        ASSET_FORMATS.unregister(".cube")
    assert asset.size == pytest.approx(0.02)
    with pytest.raises(InputError, match=r"unknown suffix '.cube'"):
        load_asset(path)
