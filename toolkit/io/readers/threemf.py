"""3MF: the unit is in the model, +Z up by the standard."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

from ....converters.registry import Format, Keeps
from ....fem.errors import InputError
from ..references import References
from .asset_formats import AssetContent
from .surface_scene import node_surfaces, parse_scene, refuse_entities

MAX_UNPACKED_BYTES = 2 * 2**30  # of an archive: more is a bomb or a scan
# Metres of the units that 3MF names; it means millimetres where it names none.
THREEMF_METRES = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip


def read_threemf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per object of the build."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        models = [m for m in archive.infolist() if m.filename.lower().endswith(".model")]
        if sum(member.file_size for member in archive.infolist()) > MAX_UNPACKED_BYTES:
            raise InputError(f"{path}: unpacks to more than {MAX_UNPACKED_BYTES} bytes")
        texts = [archive.read(model) for model in models]
    for text in texts:
        refuse_entities(path, text)
    unit = re.search(rb"<model[^>]*\bunit=[\"'](\w+)", b"".join(texts))
    metres = THREEMF_METRES.get(unit.group(1).decode().lower() if unit else "millimeter")
    return AssetContent(node_surfaces(parse_scene(path, data, references)), metres=metres, up="z")


THREEMF = Format(
    "3MF", (".3mf",), read=read_threemf, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)
