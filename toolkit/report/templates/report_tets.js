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
  // Lower and upper displacement [m] along each axis over all frames.
  bounds() {
    const lo = [0, 0, 0], hi = [0, 0, 0];
    for (let i = 0; i < this.steps.length; i += 1) {
      lo[i % 3] = Math.min(lo[i % 3], this.steps[i] * this.step);
      hi[i % 3] = Math.max(hi[i % 3], this.steps[i] * this.step);
    }
    return [lo, hi];
  }
}

class Tets {
  constructor(packed) {
    this.points = unpack(packed.points, Float32Array);
    this.tets = unpack(packed.tets, Uint32Array);
    this.region = unpack(packed.region, Uint32Array);
    this.names = packed.names;
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
  // Whether the centroid of each tet at rest is on the kept side of the cut {axis, at [m], flip}.
  kept(cut) {
    const keep = new Uint8Array(this.count).fill(1);
    if (!cut) return keep;
    for (let t = 0; t < this.count; t += 1) {
      let sum = 0;
      for (let i = 0; i < 4; i += 1) sum += this.points[3 * this.tets[4 * t + i] + cut.axis];
      keep[t] = cut.flip ? sum / 4 >= cut.at : sum / 4 <= cut.at;
    }
    return keep;
  }
  // Faces between kept tets and the rest: corner ids a, b, c and the tet that owns each face.
  boundary(keep) {
    const a = [], b = [], c = [], owner = [];
    for (let id = 0; id < this.neighbours.length; id += 1) {
      const tet = id >> 2, behind = this.neighbours[id];
      if (!keep[tet] || (behind >= 0 && keep[behind])) continue;
      const corners = this.face(tet, id & 3);
      a.push(corners[0]);
      b.push(corners[1]);
      c.push(corners[2]);
      owner.push(tet);
    }
    return { a, b, c, owner };
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
  // The boundary with its points doubled along sharp edges, so that only gentle ones look smooth:
  // corners a, b, c point into `origin`, the ids of the mesh's points.
  surface(keep) {
    const faces = this.boundary(keep);
    const origin = [], copies = new Map();
    const copyFor = (point, normal) => {
      const known = copies.get(point) || [];
      let copy = known.find((one) => dot(one.normal, normal) > SMOOTH_COSINE);
      if (!copy) {
        copy = { normal, id: origin.push(point) - 1 };
        copies.set(point, [...known, copy]);
      }
      return copy.id;
    };
    const normals = faces.a.map((a, f) => this.normal(a, faces.b[f], faces.c[f]));
    const [a, b, c] = ["a", "b", "c"].map((corner) => faces[corner].map((point, f) => copyFor(point, normals[f])));
    return { a, b, c, owner: faces.owner, origin };
  }
}
