"""Buffers packed by EXT_meshopt_compression: attributes, triangles, indices, and their filters.

After the bit streams that the extension's page specifies (Khronos glTF repository,
extensions/2.0/Vendor/EXT_meshopt_compression, "Appendix A: Bitstream" and "B: Filters"), version 0
of attributes, 1 of triangles and indices.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

GROUP, MOST = 16, 256  # elements of a group, and of a block
BLOCK_BYTES = 8192  # of a block at most, all byte channels together
TAIL = 32  # bytes at least behind the blocks, the last of them the first element
LONGEST = 256  # bytes of an element, by the specification


def unpacked(packed: bytes, extension: dict[str, Any]) -> np.ndarray:
    """Bytes (count, stride) of a buffer view, as its extension describes them.

    Raises ValueError: Where the stream is cut short, of another version, or announces too much.
    """
    count, stride = int(extension["count"]), int(extension["byteStride"])
    mode, applied = extension["mode"], extension.get("filter", "NONE")
    if not (0 < stride <= LONGEST and 0 <= count * stride <= 64 * len(packed)):
        raise ValueError(f"{count} elements of {stride} bytes in {len(packed)} bytes")
    if mode not in DECODERS or (mode == "ATTRIBUTES" and stride % 4):
        raise ValueError(f"no mode {mode} of elements of {stride} bytes")
    data = DECODERS[mode](packed, count, stride)
    if applied == "EXPONENTIAL":
        value = data.view("<i4")
        mantissa, exponent = (value << 8) >> 8, value >> 24
        return np.ldexp(mantissa.astype(np.float64), exponent).astype("<f4").view(np.uint8)
    if applied == "QUATERNION":
        three = data.view("<i2").reshape(count, 4).astype(np.int64)
        largest = three[:, 3] & 3
        parts = three[:, :3] / (three[:, 3:] | 3) / np.sqrt(2)
        rest = np.sqrt(np.maximum(0, 1 - (parts**2).sum(axis=1, keepdims=True)))
        place = (largest[:, None] + np.arange(1, 5)) % 4
        turned = np.empty((count, 4))
        np.put_along_axis(turned, place, np.hstack([parts, rest]), axis=1)
        return np.round(turned * 32767).astype("<i2").view(np.uint8)
    if applied not in ("NONE", "OCTAHEDRAL"):  # octahedral normals are not used
        raise ValueError(f"no filter {applied}")
    return data


def _attributes(packed: bytes, count: int, stride: int) -> np.ndarray:
    """Blocks of elements, byte channel after channel: zigzag differences in groups of 16."""
    if not packed or packed[0] != 0xA0 or len(packed) < 1 + max(TAIL, stride):
        raise ValueError("attributes are not of version 0")
    out, at = np.zeros((count, stride), np.uint8), 1
    before = np.frombuffer(packed, np.uint8)[-stride:]
    block = min(BLOCK_BYTES // stride // GROUP * GROUP, MOST)
    for begin in range(0, count, block):
        rows = min(block, count - begin)
        groups = -(-rows // GROUP)
        for channel in range(stride):
            head = packed[at : at + -(-groups // 4)]
            at += len(head)
            deltas = np.zeros((groups, GROUP), np.uint8)
            for group in range(groups):
                bits = (head[group // 4] >> 2 * (group % 4) & 3) << 1
                if bits == 6:
                    deltas[group] = np.frombuffer(packed, np.uint8, GROUP, at)
                    at += GROUP
                elif bits:  # fields of 2 or 4 bits, the highest first; all ones: a byte follows
                    field = np.frombuffer(packed, np.uint8, 2 * bits, at)
                    shifts = np.arange(8 - bits, -1, -bits, dtype=np.uint8)
                    fields = (field[:, None] >> shifts & ((1 << bits) - 1)).reshape(-1)
                    more = np.flatnonzero(fields == (1 << bits) - 1)
                    at += 2 * bits
                    fields[more] = np.frombuffer(packed, np.uint8, len(more), at)
                    at += len(more)
                    deltas[group] = fields
            flat = deltas.reshape(-1)[:rows]
            signed = flat >> 1 ^ -(flat & 1).astype(np.int8).view(np.uint8)
            out[begin : begin + rows, channel] = before[channel] + np.cumsum(signed, dtype=np.uint8)
        before = out[begin + rows - 1]
    return out


def _varint(stream: Iterator[int]) -> int:
    """Read a number, seven bits a byte, the lowest first."""
    value = 0
    for shift in range(0, 35, 7):
        byte = next(stream)
        value |= (byte & 127) << shift
        if byte < 128:
            break
    return value


def _zigzag(value: int) -> int:
    return value >> 1 ^ -(value & 1)


def _triangles(packed: bytes, count: int, stride: int) -> np.ndarray:
    """Triangles by an edge of the 16 last ones and a vertex of the 16 last ones, or a new one."""
    if count % 3 or packed[:1] != b"\xe1" or len(packed) < 1 + count // 3 + 16:
        raise ValueError("triangles are not of version 1")
    codes, table = packed[1 : 1 + count // 3], packed[-16:]
    stream = iter(packed[1 + count // 3 :])
    following = last = 0
    edges, vertices, out = [(0, 0)] * 16, [0] * 16, []  # the newest first
    for code in codes:
        if code < 0xF0:
            (a, b), third = edges[code >> 4], code & 15
            if third == 0:
                c, following = following, following + 1
            elif third < 13:
                c = vertices[third]
            else:
                step = _zigzag(_varint(stream)) if third == 15 else 2 * third - 27
                c = last = last + step
            if third == 0 or third >= 13:
                vertices = [c, *vertices[:15]]
            edges = [(a, c), (c, b), *edges[:14]]
        else:
            pair = table[code & 15] if code < 0xFE else next(stream)
            kinds = (15 if code == 0xFF else 0, pair >> 4, pair & 15)
            if code >= 0xFE and pair == 0:
                following = 0
            corners: list[int] = []
            for kind in kinds:
                if kind == 0:
                    corners.append(following)
                    following += 1
                elif kind == 15 and code >= 0xFE:
                    corners.append(-1)  # its number follows
                else:
                    corners.append(vertices[kind - 1])
            for order, corner in enumerate(corners):
                if corner < 0:
                    corners[order] = last = last + _zigzag(_varint(stream))
                if corner < 0 or kinds[order] == 0:
                    vertices = [corners[order], *vertices[:15]]
            a, b, c = corners
            edges = [(a, c), (c, b), (b, a), *edges[:13]]
        out.append((a, b, c))
    return np.array(out).astype(f"<u{stride}").reshape(-1, 1).view(np.uint8)


def _indices(packed: bytes, count: int, stride: int) -> np.ndarray:
    """Indices as differences to one of two last ones."""
    if packed[:1] != b"\xd1":
        raise ValueError("indices are not of version 1")
    stream, last, out = iter(packed[1:]), [0, 0], np.empty(count, np.int64)
    for number in range(count):
        value = _varint(stream)
        last[value & 1] += _zigzag(value >> 1)
        out[number] = last[value & 1]
    return out.astype(f"<u{stride}").reshape(-1, 1).view(np.uint8)


DECODERS = {"ATTRIBUTES": _attributes, "TRIANGLES": _triangles, "INDICES": _indices}
