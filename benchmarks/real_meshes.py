"""Meshes of twelve pieces of real furniture, and of the demo, made by our own ``convert``.

    python benchmarks/real_meshes.py --cache FOLDER

Debian's sweethome3d-furniture holds the pieces (fetched by apt-get once). A mesh is made at its
real size, with the default options and the sentence "a NAME", once: later calls read the cache.
"""

from __future__ import annotations

import argparse
from pathlib import Path

# Of which the tests make bodies too.
NAMES = (Path(__file__).parent / "data" / "real_pieces.txt").read_text().split()

DEMO_TEXT = "the pot is ceramic, the soil is moist soil, the trunk is oak, the foliage is leaves"


def cache_folder() -> Path:
    """Where the meshes are kept unless ``--cache`` says otherwise."""
    from platformdirs import user_cache_path

    return user_cache_path("autophyx-tet") / "benchmarks"


def real_mesh(name: str, folder: Path) -> Path:
    """Mesh file of the piece ``name``, made where ``folder`` has none."""
    path = folder / f"{name.replace('/', '-')}.msh"
    if not path.exists():
        _make(name, folder, path)
    return path


def demo_mesh(folder: Path) -> Path:
    """Mesh file of the bonsai of ``make demo``, made where ``folder`` has none."""
    from autophyx_tet.toolkit.asset.bonsai import write_bonsai

    path = folder / "demo.msh"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        _assigned(write_bonsai(folder / "bonsai.glb"), DEMO_TEXT, path)
    return path


def _make(name: str, folder: Path, path: Path) -> None:
    from autophyx_tet.research.datasets import sweethome3d

    source, _, _ = name.partition("/")
    (item,) = (i for i in sweethome3d.catalog(source) if i.key == name)
    asset = sweethome3d.extract(item, folder / "assets")
    _assigned(asset, f"a {item.name.lower()}", path, size=max(item.size))


def _assigned(asset: Path, text: str, path: Path, **options) -> None:
    """Convert ``asset``, give it the materials of ``text`` and write it to ``path``."""
    from autophyx_tet.converters.mesh.meshdata import write_mesh
    from autophyx_tet.toolkit.asset.document import Sidecar
    from autophyx_tet.toolkit.options import ConvertOptions
    from autophyx_tet.toolkit.pipeline import assign, convert

    solid = convert(asset, options=ConvertOptions(**options))
    plain = path.with_name(f"plain-{path.name}")  # its sidecar knows the axis up and the names
    write_mesh(plain, solid.mesh)
    solid.described().write(plain)
    assign(plain, text, asset=asset, output=path)
    plain.unlink()
    Sidecar.path(plain).unlink()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=cache_folder())
    options = parser.parse_args()
    for name in NAMES:
        print(real_mesh(name, options.cache), flush=True)


if __name__ == "__main__":
    main()
