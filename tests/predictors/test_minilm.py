"""Laws of the sentence encoder: it is all-MiniLM-L6-v2, it is fast, batching is harmless."""

import subprocess
import sys

import numpy as np
import pytest
from autophyx_tet.predictors.encoders.minilm import MAX_TOKENS, MiniLM, gelu, packaged_weights
from autophyx_tet.research.on_device import minilm

from .torchvision import with_operators

SENTENCES = [
    "a steel frame with an oak seat",
    "Metal_Chrome",
    "The leaves are flexible, while the ceramic pot is brittle and heavy; the trunk is wood.",
    "cuoio, legno e acciaio: 10 cm",
    "x",
    "a very stiff rigid rubber toy " * 50,
]


@pytest.fixture(scope="module")
def encoder():
    return MiniLM()


@pytest.mark.slow
def test_embeddings_are_unit_vectors_and_the_batch_does_not_matter(encoder):
    together = encoder.text(SENTENCES)
    assert together.shape == (len(SENTENCES), 384)
    assert together.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(together, axis=1), 1, atol=1e-6)
    alone = np.concatenate([encoder.text([sentence]) for sentence in SENTENCES])
    np.testing.assert_allclose(together, alone, atol=2e-6)
    np.testing.assert_array_equal(encoder.text([s.upper() for s in SENTENCES]), together)
    assert encoder.text([]).shape == (0, 384)


def test_near_meanings_are_near(encoder):
    a, b, c = encoder.text(["a chair made of oak", "wooden seat", "the stock market fell"])
    assert a @ b > a @ c + 0.2


def testgelu_is_the_exact_one():
    """GELU(x) = x Phi(x), against scipy's erf."""
    from scipy.special import erf

    x = np.linspace(-9, 9, 4001, dtype=np.float32)
    exact = x * (1 + erf(x.astype(np.float64) / np.sqrt(2))) / 2
    np.testing.assert_allclose(gelu(x), exact, atol=1e-6)


def test_a_cold_process_embeds_a_sentence_without_torch():
    """The text path starts in a fraction of a second because it loads no heavy package."""
    code = (
        "from autophyx_tet.predictors.encoders.minilm import MiniLM; MiniLM().text(['oak chair']);"
        "import sys; assert not {'torch', 'transformers', 'scipy'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def reference(folder, tokens):
    """The network by torch's own layers: its GELU, norm and attention."""
    import torch
    from safetensors.torch import load_file
    from torch.nn import functional as F

    w = {k: x.float() for k, x in load_file(folder / "model.safetensors").items()}

    def dense(name, x):
        return F.linear(x, w[f"{name}.weight"], w[f"{name}.bias"])

    def norm(name, x):
        return F.layer_norm(x, x.shape[-1:], w[f"{name}.weight"], w[f"{name}.bias"], 1e-12)

    x = w["embeddings.word_embeddings.weight"][torch.tensor(tokens)]
    x = x + w["embeddings.position_embeddings.weight"][: len(tokens)]
    x = norm("embeddings.LayerNorm", x + w["embeddings.token_type_embeddings.weight"][0])
    for layer in range(6):
        at = f"encoder.layer.{layer}"
        q, k, v = (
            dense(f"{at}.attention.self.{role}", x).unflatten(-1, (12, -1)).transpose(0, 1)
            for role in ("query", "key", "value")
        )
        seen = F.scaled_dot_product_attention(q, k, v).transpose(0, 1).flatten(1)
        x = norm(
            f"{at}.attention.output.LayerNorm", x + dense(f"{at}.attention.output.dense", seen)
        )
        inner = F.gelu(dense(f"{at}.intermediate.dense", x))
        x = norm(f"{at}.output.LayerNorm", x + dense(f"{at}.output.dense", inner))
    return F.normalize(x.mean(dim=0), dim=0).numpy()


@pytest.mark.parametrize("device", [None, "cpu"])
@pytest.mark.slow
def test_numpy_and_torch_are_one_network(device):
    """Both libraries give what torch's own layers give, to 1e-5."""
    embed = minilm(device)
    rows = [encoding.ids for encoding in embed._tokenizer.encode_batch(SENTENCES)]
    wanted = np.stack([reference(packaged_weights(), row) for row in rows])
    np.testing.assert_allclose(embed.text(SENTENCES), wanted, atol=1e-5)


@pytest.mark.slow
def test_it_is_the_reference_implementation(encoder):
    """Cosine >= .9999 with sentence-transformers on the same weights, truncation included."""
    with_operators()
    reference = pytest.importorskip("sentence_transformers")
    model = reference.SentenceTransformer(str(packaged_weights()), device="cpu")
    assert model.max_seq_length == MAX_TOKENS
    wanted = model.encode(SENTENCES, normalize_embeddings=True)
    assert (encoder.text(SENTENCES) * wanted).sum(axis=1).min() >= 0.9999
