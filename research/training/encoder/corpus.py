"""The training corpus of the image encoder: rendered objects with words for every pixel, one file.

Colour, normal, opacity and part of each picture are kept apart, so that the trainer can light,
recolour and place every object anew. Pictures are JPEG and PNG inside one safetensors file.
"""

from __future__ import annotations

import functools
import io
import json
import logging
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....fem.scene.up import up_vector
from ....predictors.appearance.surface import finish_of, material_name
from ....predictors.appearance.views import Views, hemisphere, render_views
from ....predictors.asset import Asset
from ....predictors.text.parts import KINDS, bare_words, kind_of

if TYPE_CHECKING:
    import torch

log = logging.getLogger(__name__)

VIEWS, LOWER, PIXELS = 4, 1, 288  # pictures of an object from above and below, and their side
QUALITY = 80  # of the JPEG pictures: 5 pictures of an object are about 80 kB
MOST_PARTS = 255  # parts of an object, one byte a pixel; 0 is the background
LAYERS = {"colour": "JPEG", "normal": "JPEG", "opacity": "PNG", "part": "PNG"}
# Names that modelling programs make up: they say nothing of what a part is.
_PRIMITIVES = frozenset(
    "cube plane cylinder sphere circle mesh object curve torus cone text grid group box line "
    "rectangle null none color colour default scene layer shape polygon".split()
)


class Specimen(NamedTuple):
    """An asset with the name of what it is ("Kitchen chair") and the collection it comes from."""

    asset: Asset
    name: str
    source: str


@dataclass(frozen=True, eq=False)
class Corpus:
    """Pictures and words, as tensors on one device.

    ``colour`` and ``normal`` (pictures, 3, h, w), ``opacity`` and ``part`` (pictures, h, w), all
    bytes: the normal is in the camera's axes, -1..1 as 0..255; ``part`` is a row of the part
    tables, 0 the background. ``up`` (pictures, 3) points up in the camera's axes.
    ``finish`` (parts, 3); ``words`` (parts, 4) are rows of ``embeddings`` (texts, D) or -1, for the
    kind of material, the material's name, the part's name and the object's; ``object_of`` (parts,).
    """

    colour: torch.Tensor
    normal: torch.Tensor
    opacity: torch.Tensor
    part: torch.Tensor
    up: torch.Tensor
    finish: torch.Tensor
    words: torch.Tensor
    embeddings: torch.Tensor
    object_of: torch.Tensor
    texts: tuple[str, ...]
    sources: tuple[str, ...]

    @functools.cached_property
    def mean_colour(self) -> torch.Tensor:
        """Mean unlit colour (parts, 3) in [0, 1] of every part over all its pixels."""
        import torch

        flat = self.part.reshape(-1).long()
        count = torch.bincount(flat, minlength=len(self.finish)).clamp(min=1)
        channels = [self.colour[:, k].reshape(-1).float() for k in range(3)]
        sums = [torch.bincount(flat, channel, len(self.finish)) for channel in channels]
        return torch.stack(sums, dim=1).float() / count[:, None] / 255


def write_corpus(
    path: str | Path, specimens: Iterable[Specimen], *, text_encoder: Any, pixels: int = PIXELS
) -> int:
    """Render every specimen, write the corpus to ``path`` and return the number of objects.

    ``text_encoder`` gives the embedding of every text and the vocabulary that counts as words.
    """
    from safetensors.numpy import save_file

    objects: list[dict[str, Any]] = []
    blobs: list[bytes] = []
    ups: list[np.ndarray] = []
    for specimen in specimens:
        if len(specimen.asset.parts) > MOST_PARTS:
            log.warning("%s has more than %d parts: left out", specimen.name, MOST_PARTS)
            continue
        cameras = hemisphere(
            specimen.asset.bounds, count=VIEWS, lower=LOWER, up=specimen.asset.up, pixels=pixels
        )
        views = render_views(specimen.asset, cameras)
        blobs += [blob for view in range(len(cameras)) for blob in _packed(views, view)]
        ups += [up_vector(specimen.asset.up) @ camera.pose[:3, :3] for camera in cameras]
        objects.append(_described(specimen, len(cameras)))
    texts, rows = _text_table(objects, text_encoder)
    offsets = np.cumsum([0, *map(len, blobs)])
    save_file(
        {
            "blobs": np.frombuffer(b"".join(blobs), dtype=np.uint8),
            "offsets": offsets.astype(np.int64),
            "up": np.array(ups, dtype=np.float32),
            "words": np.array(rows, dtype=np.int32),
            "embeddings": text_encoder.text(texts).astype(np.float16),
        },
        Path(path),
        metadata={"objects": json.dumps(objects), "texts": json.dumps(texts)},
    )
    return len(objects)


def read_corpus(path: str | Path, *, device: str = "cpu") -> Corpus:
    """Read a corpus and decode all its pictures into tensors on ``device``."""
    import torch
    from safetensors import safe_open

    with safe_open(str(path), framework="np") as file:
        metadata = file.metadata()
        arrays = {key: file.get_tensor(key) for key in file.keys()}
    objects = json.loads(metadata["objects"])
    layers = _decoded(arrays["blobs"].tobytes(), arrays["offsets"])
    counts = [len(o["parts"]) for o in objects]
    first = np.cumsum([1, *counts])  # row 0 of the part tables is the background
    per_picture = np.repeat(first[:-1], [o["pictures"] for o in objects])
    part = layers["part"].astype(np.int32)
    part = np.where(part > 0, part - 1 + per_picture[:, None, None], 0)
    finish = [[0.0, 0.0, 1.0], *(p["finish"] for o in objects for p in o["parts"])]
    words = np.concatenate([np.full((1, 4), -1, dtype=np.int32), arrays["words"]])
    tensors = {
        "colour": layers["colour"].transpose(0, 3, 1, 2),
        "normal": layers["normal"].transpose(0, 3, 1, 2),
        "opacity": layers["opacity"],
        "part": part,
        "up": arrays["up"],
        "finish": np.array(finish, dtype=np.float32),
        "words": words.astype(np.int64),
        "embeddings": arrays["embeddings"].astype(np.float32),
        "object_of": np.concatenate([[-1], np.repeat(np.arange(len(objects)), counts)]),
    }
    return Corpus(
        **{k: torch.from_numpy(np.ascontiguousarray(v)).to(device) for k, v in tensors.items()},
        texts=tuple(json.loads(metadata["texts"])),
        sources=tuple(o["source"] for o in objects),
    )


def _packed(views: Views, view: int) -> list[bytes]:
    """The four layers of one picture as image files, in the order of ``LAYERS``."""
    assert views.normal is not None
    assert views.part is not None
    turn = views.cameras[view].pose[:3, :3]
    layers = {
        "colour": views.colour[view],
        "normal": (views.normal[view] @ turn + 1) / 2,
        "opacity": views.opacity[view],
        "part": (views.part[view] + 1) / 255,
    }
    return [
        _image((layers[name].clip(0, 1) * 255).round().astype(np.uint8), form)
        for name, form in LAYERS.items()
    ]


def _image(pixels: np.ndarray, form: str) -> bytes:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, form, optimize=True, quality=QUALITY)
    return buffer.getvalue()


def _decoded(data: bytes, offsets: np.ndarray) -> dict[str, np.ndarray]:
    """Every layer of all pictures, stacked."""
    from PIL import Image

    def one(i: int) -> np.ndarray:
        with Image.open(io.BytesIO(data[offsets[i] : offsets[i + 1]])) as image:
            return np.asarray(image)

    with ThreadPoolExecutor() as pool:
        images = list(pool.map(one, range(len(offsets) - 1)))
    return {name: np.stack(images[k :: len(LAYERS)]) for k, name in enumerate(LAYERS)}


def _described(specimen: Specimen, pictures: int) -> dict[str, Any]:
    """What the corpus says of an object and its parts, in plain types."""
    parts = []
    for part in specimen.asset.parts:
        slot = material_name(part.mesh)
        labels = [slot] if slot else []
        labels += [label for label in part.labels if label != slot]
        parts.append({"slot": slot, "labels": labels, "finish": list(finish_of(part.mesh))})
    return {"name": specimen.name, "source": specimen.source, "pictures": pictures, "parts": parts}


def _text_table(
    objects: Sequence[dict[str, Any]], text_encoder: Any
) -> tuple[list[str], list[list[int]]]:
    """All texts (the kinds come first), and for each part the rows of its four texts."""
    rows_of = {kind: row for row, kind in enumerate(KINDS)}

    def row(text: str | None) -> int:
        return -1 if not text else rows_of.setdefault(text, len(rows_of))

    rows = []
    for thing in objects:
        name = thing["name"].lower()
        for part in thing["parts"]:
            slot = part["slot"] or ""
            labels = " ".join(_known(" ".join(part["labels"][1:]), text_encoder))
            material = " ".join(_known(slot, text_encoder))
            kind = kind_of(slot)
            rows.append([row(kind), row(material), row(labels), row(name)])
    return list(rows_of), rows


def _known(name: str, text_encoder: Any) -> list[str]:
    """Words of a name that are English, or at least whole in the encoder's vocabulary."""
    words = [word for word in bare_words(name) if word not in _PRIMITIVES]
    return list(dict.fromkeys(word for word in words if text_encoder.knows(word)))
