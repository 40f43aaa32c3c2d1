"""COLLADA 1.4 and 1.5: nodes by their names, skins after their joints; geometry by pycollada."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...fem.note import Note
from .formats import (
    MADE_UP_NAME,
    AssetContent,
    NamedSurface,
    References,
    parse_scene,
    refuse_entities,
)

KEY = "shown-"  # begins the id of the geometry of an instance


def read_collada(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and material of the scene.

    Every instance gets a geometry of its own before trimesh reads the document: by its id the
    surfaces find their nodes.

    Raises InputError: Where the unit is no length, or a skin has no joints.
    """
    from lxml import etree
    from trimesh.util import unique_name

    refuse_entities(path, data)
    parser = etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True)
    root = etree.fromstring(data, parser)
    unit = root.find("{*}asset/{*}unit")
    said = "1" if unit is None else unit.get("meter", "1")
    try:
        metres = float(said.replace(",", "."))
    except ValueError:
        metres = 0.0
    if not 0 < metres < np.inf:
        raise InputError("collada.unit", path=path, said=said)
    axis = (root.findtext("{*}asset/{*}up_axis") or "Y_UP").strip()[:1].lower()
    by_id = {element.get("id"): element for element in root.iter("{*}*") if element.get("id")}
    warnings: list[str] = []
    if holed := sum(1 for _ in root.iter("{*}ph")):
        warnings.append(Note("collada.holed", count=holed))
    names: dict[str, tuple[str, ...]] = {}
    called: dict[str, Any] = {}
    counts: dict[str | None, int] = {}
    library = root.find("{*}library_geometries")
    kinds = ("{*}instance_geometry", "{*}instance_controller", "{*}instance_node")
    for instance in list(root.iter(*kinds)):
        target = by_id.get(instance.get("url", "").lstrip("#"))
        if target is None:
            warnings.append(Note("collada.missing", url=instance.get("url", "")))
            instance.getparent().remove(instance)
            continue
        if library is None or instance.tag.endswith("instance_node"):
            continue
        nodes = list(instance.iterancestors("{*}node"))
        above = [node.get("name") or node.get("id") or "" for node in nodes]
        key = f"{KEY}{len(names)}"
        if instance.tag.endswith("instance_controller"):
            for _ in range(8):  # shape keys of shape keys, but no circles
                if target is not None and (morph := target.find("{*}morph")) is not None:
                    warnings.append(Note("collada.morph", name=above[0]))
                    target = by_id.get(morph.get("source", "").lstrip("#"))
            skin = None if target is None else target.find("{*}skin")
            geometry = target if skin is None else by_id.get(skin.get("source", "").lstrip("#"))
            if geometry is None:
                continue
            geometry = deepcopy(geometry)
            if skin is not None:
                try:
                    _bend(geometry, skin, instance, by_id)
                except (AttributeError, KeyError, IndexError) as error:
                    raise InputError("collada.skin", path=path, name=above[0]) from error
                # Joints place a skin, its own node does not
                scene = instance.getroottree().find(".//{*}visual_scene")
                etree.SubElement(scene, nodes[0].tag).append(instance)
            instance.tag = instance.tag.replace("instance_controller", "instance_geometry")
            for skeleton in instance.findall("{*}skeleton"):
                instance.remove(skeleton)
        else:
            geometry = deepcopy(target)
        shape = geometry.get("name") or ""
        shape = geometry.get("id") if MADE_UP_NAME.fullmatch(shape) else shape
        own = unique_name(above[0] if above else "", called, counts=counts)
        called[own] = names[key] = (own, shape, *above[1:])
        geometry.set("id", key)
        instance.set("url", f"#{key}")
        library.append(geometry)
    scene = parse_scene(path, etree.tostring(root), references)
    surfaces = []
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        name, mesh = str(geometry), scene.geometry[geometry].copy()
        mesh.apply_transform(matrix)
        found = names.get(KEY + name.removeprefix(KEY).partition("_")[0], (name,))
        material = getattr(getattr(mesh.visual, "material", None), "name", None)
        surfaces.append(NamedSurface(mesh, found, material))
    up = axis if axis in "xyz" else "y"
    return AssetContent(surfaces, metres=metres, up=up, warnings=tuple(warnings))  # type: ignore


COLLADA = Format(
    "COLLADA", (".dae",), read=read_collada, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)


def _numbers(element: Any) -> np.ndarray:
    return np.array((element.text or "").split(), dtype=np.float64)


def _bend(geometry: Any, skin: Any, instance: Any, by_id: dict[str, Any]) -> None:
    """Move the points of a geometry with the joints of its skin, in place.

    v' = sum of w (joint in the world) (inverse bind matrix) (bind shape matrix) v.
    """

    def source(parent: Any, semantic: str) -> Any:
        url = parent.find(f"{{*}}input[@semantic='{semantic}']").get("source")
        return by_id[url.lstrip("#")]

    joints = source(skin.find("{*}joints"), "JOINT").find("{*}Name_array")
    if joints is None:
        joints = source(skin.find("{*}joints"), "JOINT").find("{*}IDREF_array")
    inverse = _numbers(source(skin.find("{*}joints"), "INV_BIND_MATRIX").find("{*}float_array"))
    shape = skin.find("{*}bind_shape_matrix")
    shape = np.eye(4) if shape is None else _numbers(shape).reshape(4, 4)
    root = instance.getroottree().getroot()
    roots = [by_id[s.text.strip().lstrip("#")] for s in instance.findall("{*}skeleton") if s.text]
    sids = {n.get("sid"): n for top in (root, *roots) for n in top.iter("{*}node")}
    found = [sids.get(name, by_id.get(name)) for name in (joints.text or "").split()]
    matrices = [
        _world(node) @ one @ shape
        for node, one in zip(found, inverse.reshape(-1, 4, 4), strict=True)
    ]
    weighted = skin.find("{*}vertex_weights")
    offsets = {i.get("semantic"): int(i.get("offset")) for i in weighted.findall("{*}input")}
    weights = _numbers(source(weighted, "WEIGHT").find("{*}float_array"))
    counts = _numbers(weighted.find("{*}vcount")).astype(int)
    pairs = _numbers(weighted.find("{*}v")).astype(int).reshape(-1, len(offsets))
    joint, weight = pairs[:, offsets["JOINT"]], weights[pairs[:, offsets["WEIGHT"]]]
    of = np.repeat(np.arange(len(counts)), counts)
    positions = geometry.find("{*}mesh/{*}vertices/{*}input[@semantic='POSITION']").get("source")
    array = geometry.find(f"{{*}}mesh/{{*}}source[@id='{positions.lstrip('#')}']/{{*}}float_array")
    points = _numbers(array).reshape(-1, 3)
    moved, total = np.zeros_like(points), np.bincount(of, weight, len(points))
    for number, matrix in enumerate(matrices):
        share = np.bincount(of, weight * (joint == number), len(points)) / np.maximum(total, 1e-30)
        moved += share[:, None] * (points @ matrix[:3, :3].T + matrix[:3, 3])
    free = points @ shape[:3, :3].T + shape[:3, 3]  # of no joint: joint -1 is the bind shape
    moved = np.where(total[:, None] > 0, moved, free)
    array.text = " ".join(map(repr, moved.ravel().tolist()))


def _world(node: Any) -> np.ndarray:
    """Matrix (4, 4) of a node in the scene."""
    from scipy.spatial.transform import Rotation

    known: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "matrix": lambda v: v.reshape(4, 4),
        "translate": lambda v: np.block([[np.eye(3), v[:, None]], [np.zeros(3), 1]]),
        "scale": lambda v: np.diag([*v, 1]),
        "rotate": lambda v: np.block(
            [
                [Rotation.from_rotvec(v[:3], degrees=False).as_matrix(), np.zeros((3, 1))],
                [np.zeros(3), 1],
            ]
        ),
    }
    matrix = np.eye(4)
    for one in (node, *node.iterancestors("{*}node")):
        local = np.eye(4)
        for change in one:
            kind = str(change.tag).partition("}")[2]
            if kind in known:
                values = _numbers(change)
                if kind == "rotate":  # about an axis by degrees
                    length = np.linalg.norm(values[:3]) or 1.0
                    values = values[:3] / length * np.radians(values[3])
                local = local @ known[kind](values)
        matrix = local @ matrix
    return matrix
