"""Independent little writers of the read-only splat formats, from their published layouts."""

import gzip
import struct

import numpy as np
from autophyx_tet.converters.points.gaussians import SH_C0


def standard(n=300, k=0, seed=0):
    """Plain values of n splats with k harmonics a channel, inside the range of every format."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(n, 4))
    return {
        "means": rng.uniform(-2, 2, (n, 3)),
        "log_scales": rng.uniform(-6, -2, (n, 3)),
        "rotations": q / np.linalg.norm(q, axis=1, keepdims=True) * np.sign(q[:, :1]),
        "opacity": rng.uniform(0.05, 0.95, n),
        "f_dc": rng.uniform(-1.5, 1.5, (n, 3)),
        "f_rest": rng.uniform(-0.9, 0.9, (n, 3, k)) if k else None,
    }


def _byte(share):
    return np.clip(np.rint(share * 255), 0, 255).astype(np.uint8)


def splat(v):
    n = len(v["means"])
    rgba = np.column_stack([v["f_dc"] * SH_C0 + 0.5, v["opacity"]])
    rows = np.zeros(n, dtype=[("p", "<f4", 3), ("s", "<f4", 3), ("c", "u1", 4), ("q", "u1", 4)])
    rows["p"], rows["s"], rows["c"] = v["means"], np.exp(v["log_scales"]), _byte(rgba)
    rows["q"] = np.clip(np.rint(v["rotations"] * 128 + 128), 0, 255)
    return rows.tobytes()


def _smallest_three(q, bits_of):
    """Words of 2 + 3 x 10 bits: place of the largest component, then the others in order."""
    place = np.abs(q).argmax(axis=1)
    q = q * np.sign(np.take_along_axis(q, place[:, None], axis=1))
    word = place.astype(np.uint32)
    others = np.array([[j for j in range(4) if j != i] for i in range(4)])[place]
    for column in np.take_along_axis(q, others, axis=1).T:
        word = word << np.uint32(10) | bits_of(column).astype(np.uint32)
    return word


def spz(v, version):
    n, rest = len(v["means"]), v["f_rest"]
    degree = {0: 0, 3: 1, 8: 2, 15: 3}[0 if rest is None else rest.shape[2]]
    head = struct.pack("<4sIIBBBB", b"NGSP", version, n, degree, 12, 0, 0)
    if version == 1:
        position = v["means"].astype("<f2").tobytes()
    else:
        fixed = np.rint(v["means"] * 4096).astype("<i4")
        position = fixed.view(np.uint8).reshape(n, 3, 4)[:, :, :3].tobytes()
    wxyz = v["rotations"]
    if version >= 3:
        half = 0.5**0.5

        def bits_of(x):
            return (x < 0) * 512 + np.rint(np.abs(x) / half * 511)

        rotation = _smallest_three(wxyz[:, [1, 2, 3, 0]], bits_of).astype("<u4").tobytes()
    else:
        rotation = np.rint(wxyz[:, 1:] * 127.5 + 127.5).astype(np.uint8).tobytes()
    colour = _byte(v["f_dc"] * 0.15 + 0.5).tobytes()
    scale = np.rint((v["log_scales"] + 10) * 16).astype(np.uint8).tobytes()
    sh = b""
    if rest is not None:
        sh = (
            np.clip(np.rint(rest.transpose(0, 2, 1) * 128 + 128), 0, 255).astype(np.uint8).tobytes()
        )
    planes = [position, _byte(v["opacity"]).tobytes(), colour, scale, rotation, sh]
    if version < 4:
        return gzip.compress(head + b"".join(planes))
    import zstandard

    planes = [plane for plane in planes if plane]
    head = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, n, degree, 12, 0, len(planes), 32)
    packed = [zstandard.ZstdCompressor().compress(plane) for plane in planes]
    contents = [struct.pack("<QQ", len(p), len(q)) for p, q in zip(packed, planes, strict=True)]
    return head + b"".join(contents) + b"".join(packed)


def packed_ply(v):
    """SuperSplat's chunks of 256: bounds as floats, values as 11-10-11 bits between them."""
    n, k = len(v["means"]), 0 if v["f_rest"] is None else v["f_rest"].shape[2]
    chunks = [slice(i, i + 256) for i in range(0, n, 256)]
    names = [f"{end}_{a}" for end in ("min", "max") for a in ("x", "y", "z")]
    names += [f"{end}_scale_{a}" for end in ("min", "max") for a in ("x", "y", "z")]
    bounds = np.array(
        [
            np.concatenate([f(v[key][c], axis=0) for key in ("means", "log_scales")
                            for f in (np.min, np.max)])
            for c in chunks
        ],
        dtype="<f4",
    )  # fmt: skip

    def pack(key, at):
        words = []
        for i, c in enumerate(chunks):
            low, high = bounds[i, at : at + 3], bounds[i, at + 3 : at + 6]
            level = np.rint((v[key][c] - low) / (high - low) * [2047, 1023, 2047])
            x, y, z = np.clip(level, 0, [2047, 1023, 2047]).astype(np.uint32).T
            words.append(x << np.uint32(21) | y << np.uint32(11) | z)
        return np.concatenate(words)

    rgba = _byte(np.column_stack([v["f_dc"] * SH_C0 + 0.5, v["opacity"]])).astype(np.uint32)
    colour = rgba[:, 0] << 24 | rgba[:, 1] << 16 | rgba[:, 2] << 8 | rgba[:, 3]
    rotation = _smallest_three(v["rotations"], lambda x: np.rint((x / 2**0.5 + 0.5) * 1023))
    vertex = np.stack([pack("means", 0), rotation, pack("log_scales", 6), colour], axis=1)
    lines = ["ply", "format binary_little_endian 1.0", f"element chunk {len(chunks)}"]
    lines += [f"property float {name}" for name in names]
    lines += [f"element vertex {n}"]
    lines += [f"property uint packed_{x}" for x in ("position", "rotation", "scale", "color")]
    tail = b""
    if k:
        lines += [f"element sh {n}", *(f"property uchar f_rest_{i}" for i in range(3 * k))]
        tail = np.clip(v["f_rest"].reshape(n, -1) / 8 * 256 + 128, 0, 255).astype("u1").tobytes()
    head = "\n".join([*lines, "end_header\n"]).encode()
    return head + bounds.tobytes() + vertex.astype("<u4").tobytes() + tail


def ksplat(v, level):
    """One section; levels 1 and 2 count positions from the centres of buckets of 256."""
    n, k = len(v["means"]), 0 if v["f_rest"] is None else v["f_rest"].shape[2]
    size, quanta, capacity = 5.0, 32767, 256
    real, harmonic = ("<f4", "<f4") if level == 0 else ("<f2", "<f2" if level == 1 else "u1")
    place = "<f4" if level == 0 else "<u2"
    rows = np.zeros(n, dtype=[("p", place, 3), ("s", real, 3), ("q", real, 4), ("c", "u1", 4),
                              ("sh", harmonic, 3 * k)])  # fmt: skip
    centres = np.array([v["means"][i : i + capacity].mean(axis=0) for i in range(0, n, capacity)])
    rows["p"] = v["means"]
    if level:
        offset = v["means"] - centres.astype("<f4")[np.arange(n) // capacity]
        rows["p"] = np.rint(offset / (size / 2) * quanta) + quanta
    rows["s"], rows["q"] = np.exp(v["log_scales"]), v["rotations"]
    rows["c"] = _byte(np.column_stack([v["f_dc"] * SH_C0 + 0.5, v["opacity"]]))
    if k:
        bands = [slice(0, 3), slice(3, 8), slice(8, 15)][: {3: 1, 8: 2, 15: 3}[k]]
        sh = np.concatenate([v["f_rest"][:, :, band].reshape(n, -1) for band in bands], axis=1)
        rows["sh"] = np.rint((sh + 1.5) / 3 * 255) if level == 2 else sh
    full, partial = divmod(n, capacity)
    head = bytearray(4096)
    struct.pack_into("<BBxxIIIIH", head, 0, 0, 1, 1, 1, n, n, level)
    struct.pack_into("<ff", head, 36, -1.5, 1.5)
    section = bytearray(1024)
    buckets = len(centres) if level else 0
    struct.pack_into("<IIII", section, 0, n, n, capacity, buckets)
    struct.pack_into("<fH", section, 16, size, 12)
    struct.pack_into("<I", section, 24, quanta)
    struct.pack_into("<II", section, 32, full if level else 0, int(partial > 0) if level else 0)
    struct.pack_into("<H", section, 40, {0: 0, 3: 1, 8: 2, 15: 3}[k])
    space = struct.pack("<I", partial) + centres.astype("<f4").tobytes() if level else b""
    return bytes(head) + bytes(section) + space + rows.tobytes()
