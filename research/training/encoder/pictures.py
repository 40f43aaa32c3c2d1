"""Training pictures: objects of the corpus under new light, in new colours and places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....predictors.appearance.surface import Finish
from ....predictors.appearance.views import (
    AMBIENT,
    BACKGROUND,
    FIELD_OF_VIEW,
    GLARE,
    GROUND,
    LAMP,
    MIRRORED,
    SHARPEST,
    SKY,
    SKY_EDGE,
)
from .corpus import Corpus

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True)
class Variety:
    """How much the pictures vary: chances in [0, 1] and spreads; all zero shows the plain views."""

    recolour: float = 0.2  # chance that a part gets another colour
    plain_finish: float = 0.25  # chance that a part's finish is not known
    light: float = 1.0
    background: float = 0.8  # chance of another background than grey
    place: float = 1.0
    noise: float = 0.02


NO_VARIETY = Variety(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Pictures(NamedTuple):
    """Colour and opacity (n, 4, side, side) in [0, 1], and the part (n, side, side) of pixels."""

    images: torch.Tensor
    part: torch.Tensor


class _Light(NamedTuple):
    """Light of each picture: direction to the lamp and up (n, 3, 1, 1), strengths (n, 1, 1, 1)."""

    lamp_at: torch.Tensor
    up: torch.Tensor
    ambient: torch.Tensor
    lamp: torch.Tensor
    mirrored: torch.Tensor


def draw_pictures(
    corpus: Corpus, index: torch.Tensor, *, variety: Variety, side: int, generator: torch.Generator
) -> Pictures:
    """Draw the pictures ``index`` (n,) of the corpus, varied, ``side`` pixels wide."""
    import torch

    rand = _Dice(generator, corpus.colour.device)
    part = corpus.part[index].long()
    colour = corpus.colour[index].float() / 255
    colour = (colour * _gains(corpus, part, variety, rand)).clamp(0, 1)
    finish = corpus.finish
    if variety.plain_finish:
        unknown = rand.uniform(len(finish), 1) < variety.plain_finish
        finish = torch.where(unknown, torch.tensor(Finish(), device=finish.device), finish)
    normal = torch.nn.functional.normalize(corpus.normal[index].float() / 127.5 - 1, dim=1)
    light = _light(corpus.up[index], variety.light, rand)
    lit = _lit(colour, normal, finish[part].permute(0, 3, 1, 2), light)
    cover = corpus.opacity[index].float()[:, None] / 255
    images = lit * cover + _background(lit, variety, rand) * (1 - cover)
    images, part = _placed(torch.cat([images, cover], dim=1), part, variety.place, side, rand)
    if variety.noise:
        grain = rand.normal(len(images), 3, side, side) * rand.uniform(len(images), 1, 1, 1)
        images[:, :3] += variety.noise * grain
    return Pictures(images.clamp(0, 1), part)


class _Dice:
    """Random tensors from one generator on one device."""

    def __init__(self, generator: torch.Generator, device: torch.device) -> None:
        self._options: dict[str, Any] = {"generator": generator, "device": device}

    def uniform(self, *shape: int) -> torch.Tensor:
        import torch

        return torch.rand(shape, **self._options)

    def normal(self, *shape: int) -> torch.Tensor:
        import torch

        return torch.randn(shape, **self._options)


def _gains(corpus: Corpus, part: torch.Tensor, variety: Variety, rand: _Dice) -> torch.Tensor:
    """Factors (n, 3, h, w) that turn the mean colour of some parts into another one."""
    import torch

    gains = torch.ones(len(corpus.finish), 3, device=part.device)
    if variety.recolour:
        wanted = rand.uniform(len(gains), 3) ** 1.5  # dark colours as often as bright ones
        ratio = wanted / corpus.mean_colour.clamp(min=0.05)
        gains = torch.where(rand.uniform(len(gains), 1) < variety.recolour, ratio, gains)
    if variety.light:
        gains = gains * (1 + 0.1 * variety.light * rand.normal(*gains.shape)).clamp(min=0.5)
    return gains[part].permute(0, 3, 1, 2)


def _light(up: torch.Tensor, spread: float, rand: _Dice) -> _Light:
    """The views' own light, or a lamp, sky and strengths spread around it."""
    import torch

    n = len(up)
    lamp_at = torch.tensor([0.0, 0.0, 1.0], device=up.device) + 0.5 * spread * rand.normal(n, 3)
    sky = up + 0.3 * spread * rand.normal(n, 3)
    lamp_at, sky = (
        torch.nn.functional.normalize(v, dim=1)[..., None, None] for v in (lamp_at, sky)
    )

    def strength(mean: float) -> torch.Tensor:
        return mean * torch.exp(0.3 * spread * rand.normal(n, 1, 1, 1))

    return _Light(lamp_at, sky, strength(AMBIENT), strength(LAMP), strength(MIRRORED))


def _lit(
    colour: torch.Tensor, normal: torch.Tensor, finish: torch.Tensor, light: _Light
) -> torch.Tensor:
    """The model of ``views.shade`` in the camera's axes, with any lamp."""
    import torch

    looking = _looking(colour.shape[-2:], colour.device)
    metallic, reflectance, roughness = finish.split(1, dim=1)
    cosine = (looking * normal).sum(dim=1, keepdim=True)
    mirrored = looking - 2 * cosine * normal
    toward = (light.lamp_at * normal).sum(dim=1, keepdim=True).clamp(min=0)
    glance = (light.lamp_at * mirrored).sum(dim=1, keepdim=True).clamp(min=0)
    base = reflectance * (1 - metallic) + colour * metallic
    fresnel = base + (1 - base) * (1 - cosine.abs()) ** 5 * (1 - roughness)
    height = (mirrored * light.up).sum(dim=1, keepdim=True)
    sky = torch.sigmoid(height / (SKY_EDGE + roughness))
    # About the reflected ray the same highlight has a quarter of the exponent (Blinn and Phong).
    highlight = glance ** (0.5 / roughness.clamp(min=SHARPEST) ** 4)
    diffuse = colour * (1 - metallic) * (light.ambient + light.lamp * toward)
    return diffuse + light.mirrored * fresnel * (GROUND + (SKY - GROUND) * sky + GLARE * highlight)


def _looking(size: tuple[int, ...], device: torch.device) -> torch.Tensor:
    """Unit directions (1, 3, h, w) of the rays of the corpus's cameras, in the camera's axes."""
    import torch

    height, width = size
    half = float(np.tan(FIELD_OF_VIEW / 2))
    y, x = torch.meshgrid(
        half * (1 - (2 * torch.arange(height, device=device) + 1) / height),
        half * ((2 * torch.arange(width, device=device) + 1) / width - 1),
        indexing="ij",
    )
    rays = torch.stack([x, y, -torch.ones_like(x)])
    return torch.nn.functional.normalize(rays, dim=0)[None]


def _background(images: torch.Tensor, variety: Variety, rand: _Dice) -> torch.Tensor:
    """Grey, or one colour with smooth patches of another."""
    import torch
    import torch.nn.functional as F

    n, _, height, width = images.shape
    grey = torch.full((n, 3, 1, 1), BACKGROUND, device=images.device)
    if not variety.background:
        return grey
    patches = F.interpolate(rand.uniform(n, 3, 5, 5), size=(height, width), mode="bilinear")
    busy = rand.uniform(n, 1, 1, 1) ** 2
    other = rand.uniform(n, 3, 1, 1) * (1 - busy) + patches * busy
    return torch.where(rand.uniform(n, 1, 1, 1) < variety.background, other, grey)


def _placed(
    images: torch.Tensor, part: torch.Tensor, spread: float, side: int, rand: _Dice
) -> tuple[torch.Tensor, torch.Tensor]:
    """Turn, zoom, shift, mirror and cut the pictures; ``spread`` zero only resizes them."""
    import torch
    import torch.nn.functional as F

    n = len(images)
    turn = 0.15 * spread * rand.normal(n)
    zoom = (
        torch.exp(spread * (0.6 * rand.uniform(n) - 0.45)) * 0.95**spread
    )  # 0.6 .. 1.1 of the view
    flip = 1 - 2 * (rand.uniform(n) < 0.5 * spread).float()
    cosine, sine = zoom * torch.cos(turn), zoom * torch.sin(turn)
    shift = spread * 0.5 * (1 - zoom).clamp(min=0.1)[:, None] * rand.normal(n, 2).clamp(-1.5, 1.5)
    rows = torch.stack(
        [
            torch.stack([cosine * flip, -sine, shift[:, 0]], dim=1),
            torch.stack([sine * flip, cosine, shift[:, 1]], dim=1),
        ],
        dim=1,
    )
    where = F.affine_grid(rows, [n, 1, side, side], align_corners=False)
    moved = F.grid_sample(
        images, where, mode="bilinear", padding_mode="border", align_corners=False
    )
    labels = F.grid_sample(
        part[:, None].float(), where, mode="nearest", padding_mode="zeros", align_corners=False
    )
    return moved, labels[:, 0].long()
