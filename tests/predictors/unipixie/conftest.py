"""A table of ranges whose words are random vectors: what is learned of them is not the point."""

import numpy as np
import pytest


@pytest.fixture(scope="session")
def ranges(tmp_path_factory):
    """Its file."""
    from autophyx_tet.research.datasets.ranges import build_range_table

    def random_vectors(texts):
        found = np.random.default_rng(0).normal(size=(len(texts), 384))
        return found / np.linalg.norm(found, axis=1, keepdims=True)

    path = tmp_path_factory.mktemp("ranges") / "ranges.safetensors"
    build_range_table(random_vectors).save(path)
    return path


@pytest.fixture(scope="session")
def names(ranges):
    """The same on the CPU."""
    from autophyx_tet.research.datasets.ranges import RangeTable
    from autophyx_tet.research.training.unipixie.names_on_device import Names

    return Names(RangeTable.load(ranges), "cpu")
