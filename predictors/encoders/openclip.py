"""OpenCLIP as an encoder: words as it gives them, pictures by the value path of its last block.

CLIP is trained to describe whole pictures. After MaskCLIP (Zhou et al. 2022) a patch's own place in
the space of words is out_proj(W_v ln(x) + b_v) of the last block, without attention, residual and
MLP. Weights are never downloaded here: they come from a file or from the local Hugging Face cache.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError

MODEL, PRETRAINED = "ViT-L-14", "datacomp_xl_s13b_b90k"
CACHED_NAMES = ("open_clip_model.safetensors", "open_clip_pytorch_model.bin")
BATCH = 4  # pictures at once: a ViT-L holds about 100 MB of activations for each


class OpenClip:
    """An OpenCLIP model (a ViT) as dense encoder; ``pretrained`` is a tag or a file of weights.

    Raises InputError: If the package or the weights are missing.
    """

    def __init__(
        self, model: str = MODEL, pretrained: str = PRETRAINED, *, device: str = "cpu"
    ) -> None:
        try:
            import open_clip  # (an extra)
        except ImportError as error:
            raise InputError("openclip.encoder_openclip", name=error.name) from error
        weights = _weights_file(open_clip, model, pretrained)
        network = open_clip.create_model(model, pretrained=str(weights), device=device)
        self._use(network, open_clip.get_tokenizer(model))
        self.name = f"openclip:{model}/{pretrained}"

    @classmethod
    def with_weights(cls, weights: str) -> OpenClip:
        """Return the default model with the weights of a tag or a file."""
        return cls(pretrained=weights)

    @classmethod
    def of(cls, network: Any, tokenizer: Any) -> OpenClip:
        """Wrap a model that is already in memory."""
        encoder = cls.__new__(cls)
        encoder._use(network, tokenizer)
        encoder.name = "openclip:given"
        return encoder

    def _use(self, network: Any, tokenizer: Any) -> None:
        if not hasattr(network.visual, "transformer"):
            raise InputError("openclip.picture_side", name=type(network.visual).__name__)
        self._network, self._tokenizer = network.eval(), tokenizer
        self.dim = int(network.visual.proj.shape[1])

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Unit embedding of each sentence."""
        import torch

        device = self._network.visual.proj.device
        with torch.inference_mode():
            tokens = self._tokenizer(list(sentences)).to(device)
            return self._network.encode_text(tokens, normalize=True).float().cpu().numpy()

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Unit vectors, one per patch; pictures are resized to the nearest whole patches."""
        import torch
        import torch.nn.functional as F

        visual = self._network.visual
        patch = visual.conv1.kernel_size
        size = [max(round(n / p), 1) * p for n, p in zip(images.shape[1:3], patch, strict=True)]
        mean, std = (
            torch.tensor(values, device=visual.proj.device)[:, None, None]
            for values in (visual.image_mean, visual.image_std)
        )
        out = []
        with torch.inference_mode():
            for start in range(0, len(images), BATCH):
                batch = torch.from_numpy(images[start : start + BATCH, ..., :3].astype(np.float32))
                batch = batch.to(visual.proj.device).permute(0, 3, 1, 2)
                batch = F.interpolate(batch, size=size, mode="bicubic", antialias=True)
                # Projected values (n, rows, columns, dim) of the last block's patches
                x = visual.conv1((batch - mean) / std)
                rows, columns = x.shape[-2:]
                x = x.flatten(2).transpose(1, 2)
                first = visual.class_embedding.expand(len(x), 1, -1)
                # Class token and patches plus their places, resized to rows x columns
                places, grid = visual.positional_embedding, tuple(visual.grid_size)
                at = places[1:].T.unflatten(1, grid)[None]
                if grid != (rows, columns):
                    at = F.interpolate(at, (rows, columns), mode="bicubic", antialias=True)
                x = x + at.flatten(2).transpose(1, 2)
                x = visual.ln_pre(torch.cat([first + places[:1], x], dim=1))
                # Blocks of older models want (tokens, n, width).
                transformer = visual.transformer
                x = x if transformer.batch_first else x.transpose(0, 1)
                for block in transformer.resblocks[:-1]:
                    x = block(x)
                x = x if transformer.batch_first else x.transpose(0, 1)
                last = transformer.resblocks[-1]
                width = x.shape[-1]
                value = last.attn.in_proj_weight[2 * width :], last.attn.in_proj_bias[2 * width :]
                x = last.ln_1(x[:, 1:]) @ value[0].T + value[1]  # without the class token
                x = visual.ln_post(last.attn.out_proj(x)) @ visual.proj
                vectors = F.normalize(x.unflatten(1, (rows, columns)), dim=-1)
                out.append(vectors.cpu().numpy())
        return np.concatenate(out)


def _weights_file(open_clip: Any, model: str, pretrained: str) -> Path:
    """The file of weights, without ever asking the network."""
    if Path(pretrained).is_file():
        return Path(pretrained)
    config = open_clip.pretrained.get_pretrained_cfg(model, pretrained)
    hub = str(config.get("hf_hub", "")).strip("/")
    named = {"model": model, "pretrained": pretrained}
    if not hub:
        known = ", ".join(open_clip.list_pretrained_tags_by_model(model)) or "none"
        raise InputError("openclip.openclip_weights", known=known, **named)
    from huggingface_hub import try_to_load_from_cache

    for name in CACHED_NAMES:
        found = try_to_load_from_cache(hub, name)
        if isinstance(found, str):
            return Path(found)
    raise InputError("openclip.weights_machine", hub=hub, cached_names=CACHED_NAMES[0], **named)
