"""Fixtures that tests of the networks share."""

import pytest


@pytest.fixture(scope="module")
def one_thread():
    """Tensors this small are slower with more threads, on a busy machine a hundredfold."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
