// The drawn surface: the boundary of what is shown, cut by a plane, with a cap through its tets.

// Its points lie on edges of the mesh: from `origin` towards `other` by `share`.
class Surface {
  constructor(tets, keep, cut) {
    Object.assign(this, { tets, keep, cut, a: [], b: [], c: [], owner: [], origin: [], other: [], share: [], outline: [] });
    this.copies = new Map();
    this.addBoundary();
    if (cut) this.addCap();
  }
  // Signed distance [m] of a point at rest from the cut: what is above it is taken away.
  above(point) {
    const { axis, at, flip } = this.cut;
    const away = this.tets.points[3 * point + axis] - at;
    return flip ? -away : away;
  }
  inside(point) {
    return !this.cut || this.above(point) <= 0;
  }
  crossing(p, q) {
    const [from, to] = p < q ? [p, q] : [q, p];
    const [start, end] = [this.above(from), this.above(to)];
    return [from, to, start / (start - end)];
  }
  at([p, q, share]) {
    const { points } = this.tets;
    return [0, 1, 2].map((i) => (1 - share) * points[3 * p + i] + share * points[3 * q + i]);
  }
  // Faces between what is kept and the rest, what lies above the cut clipped off.
  addBoundary() {
    const { tets, keep } = this;
    for (let id = 0; id < tets.neighbours.length; id += 1) {
      const tet = id >> 2, behind = tets.neighbours[id];
      if (!keep[tet] || (behind >= 0 && keep[behind])) continue;
      const corners = tets.face(tet, id & 3);
      const left = this.clipped(corners);
      if (left.length > 2) this.addPolygon(left, tets.normal(...corners), tet);
    }
  }
  clipped(corners) {
    return corners.flatMap((point, i) => {
      const next = corners[(i + 1) % corners.length];
      const here = this.inside(point) ? [[point, point, 0]] : [];
      return this.inside(point) === this.inside(next) ? here : [...here, this.crossing(point, next)];
    });
  }
  // The section of every tet that the plane passes through: three or four corners.
  addCap() {
    const { tets, keep, cut } = this;
    const normal = [0, 1, 2].map((axis) => (axis === cut.axis ? (cut.flip ? -1 : 1) : 0));
    for (let tet = 0; tet < tets.count; tet += 1) {
      if (!keep[tet]) continue;
      const corners = [0, 1, 2, 3].map((i) => tets.tets[4 * tet + i]);
      const below = corners.filter((point) => this.inside(point)), beyond = corners.filter((point) => !this.inside(point));
      if (!below.length || !beyond.length) continue;
      const ways = below.map((p) => beyond.map((q) => this.crossing(p, q)));
      const ring = below.length === 2 ? [...ways[0], ...ways[1].reverse()] : ways.flat();
      this.addPolygon(this.facing(ring, normal), normal, tet);
    }
  }
  facing(ring, normal) {
    const [o, p, q] = ring.map((corner) => this.at(corner));
    const [u, v] = [p, q].map((x) => x.map((value, i) => value - o[i]));
    const turn = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    return dot(turn, normal) < 0 ? ring.reverse() : ring;
  }
  addPolygon(ring, normal, tet) {
    const ids = ring.map((corner) => this.copy(corner, normal));
    for (let i = 1; i + 1 < ids.length; i += 1) {
      this.a.push(ids[0]);
      this.b.push(ids[i]);
      this.c.push(ids[i + 1]);
      this.owner.push(tet);
    }
    this.outline.push(ids);
  }
  // Points are doubled along sharp edges, so that only gentle ones look smooth.
  copy([p, q, share], normal) {
    const key = p === q ? p : (p + 1) * this.tets.pointCount + q;
    const known = this.copies.get(key) || [];
    let found = known.find((one) => dot(one.normal, normal) > SMOOTH_COSINE);
    if (!found) {
      found = { normal, id: this.origin.push(p) - 1 };
      this.other.push(q);
      this.share.push(share);
      this.copies.set(key, [...known, found]);
    }
    return found.id;
  }
  // Coordinates at rest [m] along an axis of the mesh.
  atRest(axis) {
    return Float32Array.from(this.origin, (p, k) => this.at([p, this.other[k], this.share[k]])[axis]);
  }
  // Pairs of points: the edges of the faces and of the sections, each once.
  edges() {
    const seen = new Set(), pairs = [];
    for (const ids of this.outline) {
      ids.forEach((id, i) => {
        const next = ids[(i + 1) % ids.length], key = Math.min(id, next) * this.origin.length + Math.max(id, next);
        if (!seen.has(key)) pairs.push([id, next]);
        seen.add(key);
      });
    }
    return pairs;
  }
}
