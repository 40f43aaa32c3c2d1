"use strict";
// Decoding of the data block, and the tetrahedra: neighbours and the boundary of a chosen subset.

const FACES = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]; // outward, opposite to vertex i

const SMOOTH_COSINE = Math.cos((40 * Math.PI) / 180); // sharper edges than this are drawn sharp

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function unpack(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Frames of displacement, stored as 16-bit steps of `step` metres.
class Frames {
  constructor(packed, points) {
    this.count = packed.frames;
    this.step = packed.step;
    this.size = 3 * points;
    this.steps = unpack(packed.steps, Int16Array);
  }
  // Displacement [m] of one frame, interleaved x y z.
  at(frame) {
    const steps = this.steps.subarray(frame * this.size, (frame + 1) * this.size);
    return Float32Array.from(steps, (s) => s * this.step);
  }
  largest() {
    let most = 0;
    for (let i = 0; i < this.steps.length; i += 3) {
      most = Math.max(most, Math.hypot(this.steps[i], this.steps[i + 1], this.steps[i + 2]));
    }
    return most * this.step;
  }
  // Function of a factor: the lowest and highest corner [m] of points that move by that much of it.
  // Between no motion and the factor the way is straight: its ends bound it.
  reach(points) {
    return (factor) => {
      const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
      for (let i = 0; i < this.steps.length; i += 1) {
        const x = points[i % this.size] + factor * this.step * this.steps[i];
        if (x < lo[i % 3]) lo[i % 3] = x;
        if (x > hi[i % 3]) hi[i % 3] = x;
      }
      return [lo, hi];
    };
  }
}

class Tets {
  constructor(packed) {
    this.points = unpack(packed.points, Float32Array);
    this.tets = unpack(packed.tets, Uint32Array);
    this.region = unpack(packed.region, Uint32Array);
    this.names = packed.names;
    this.look = packed.look && { colors: packed.look.colors, index: unpack(packed.look.index, Uint8Array) };
    this.count = this.tets.length / 4;
    this.pointCount = this.points.length / 3;
    this.neighbours = this.findNeighbours();
    [this.lo, this.hi] = this.findBounds();
  }
  face(tet, side) {
    return FACES[side].map((corner) => this.tets[4 * tet + corner]);
  }
  // Tet behind each of the four faces of every tet, -1 on the boundary.
  findNeighbours() {
    const neighbours = new Int32Array(4 * this.count).fill(-1);
    const seen = new Map();
    for (let id = 0; id < neighbours.length; id += 1) {
      const [a, b, c] = this.face(id >> 2, id & 3).sort((p, q) => p - q);
      const key = (a * this.pointCount + b) * this.pointCount + c;
      const other = seen.get(key);
      if (other === undefined) {
        seen.set(key, id);
      } else {
        neighbours[id] = other >> 2;
        neighbours[other] = id >> 2;
      }
    }
    return neighbours;
  }
  findBounds() {
    const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
    for (const point of this.tets) {
      for (let axis = 0; axis < 3; axis += 1) {
        const x = this.points[3 * point + axis];
        if (x < lo[axis]) lo[axis] = x;
        if (x > hi[axis]) hi[axis] = x;
      }
    }
    return [lo, hi];
  }
  // Which tets are shown: those whose part is not hidden.
  shown(hidden) {
    return Uint8Array.from(this.region, (region) => (hidden.has(this.names[region]) ? 0 : 1));
  }
  // Unit normal at rest of the face a, b, c.
  normal(a, b, c) {
    const at = (point, axis) => this.points[3 * point + axis];
    const edge = (point) => [0, 1, 2].map((axis) => at(point, axis) - at(a, axis));
    const [p, q] = [edge(b), edge(c)];
    const n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    const size = Math.hypot(...n) || 1;
    return n.map((part) => part / size);
  }
}
