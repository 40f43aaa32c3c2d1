"""Laws of the sentence encoder: it is all-MiniLM-L6-v2, it is fast, batching is harmless."""

import subprocess
import sys

import numpy as np
import pytest
from autophyx_tet.predictors.encoders.minilm import MAX_TOKENS, MiniLM, _gelu, packaged_weights

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


def test_gelu_is_the_exact_one():
    """GELU(x) = x Phi(x), against scipy's erf."""
    from scipy.special import erf

    x = np.linspace(-9, 9, 4001, dtype=np.float32)
    exact = x * (1 + erf(x.astype(np.float64) / np.sqrt(2))) / 2
    np.testing.assert_allclose(_gelu(x), exact, atol=1e-6)


def test_a_cold_process_embeds_a_sentence_without_torch():
    """The text path starts in a fraction of a second because it loads no heavy package."""
    code = (
        "from autophyx_tet.predictors.encoders.minilm import MiniLM; MiniLM().text(['oak chair']);"
        "import sys; assert not {'torch', 'transformers', 'scipy'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_it_is_the_reference_implementation(encoder):
    """Cosine >= .9999 with sentence-transformers on the same weights, truncation included."""
    reference = pytest.importorskip("sentence_transformers")
    model = reference.SentenceTransformer(str(packaged_weights()), device="cpu")
    assert model.max_seq_length == MAX_TOKENS
    wanted = model.encode(SENTENCES, normalize_embeddings=True)
    assert (encoder.text(SENTENCES) * wanted).sum(axis=1).min() >= 0.9999
