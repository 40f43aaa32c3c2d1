// A body in few coordinates q of unit mass: neo-Hookean cells, BDF2, Newton, a spring that pulls it.

const NEWTON = 2; // iterations of a step
const MOST_HALVINGS = 3; // a step that fails is halved so often at most
// Rows and columns of a tensor in the two skew terms of the second derivative of det F.
const SKEW = [[0, 1, 2, 1], [1, 2, 0, 1], [2, 0, 1, 1], [1, 0, 2, -1], [2, 1, 0, -1], [0, 2, 1, -1]];

// Cofactor of a 3 x 3 tensor, row by row.
function cofactor(T, out) {
  out[0] = T[4] * T[8] - T[5] * T[7]; out[1] = T[5] * T[6] - T[3] * T[8]; out[2] = T[3] * T[7] - T[4] * T[6];
  out[3] = T[2] * T[7] - T[1] * T[8]; out[4] = T[0] * T[8] - T[2] * T[6]; out[5] = T[1] * T[6] - T[0] * T[7];
  out[6] = T[1] * T[5] - T[2] * T[4]; out[7] = T[2] * T[3] - T[0] * T[5]; out[8] = T[0] * T[4] - T[1] * T[3];
}

// Lower Cholesky factor of K (n x n, its lower half) in place; false where it is not positive.
function factorise(K, n) {
  for (let j = 0; j < n; j += 1) {
    for (let i = j; i < n; i += 1) {
      let sum = K[i * n + j];
      for (let k = 0; k < j; k += 1) sum -= K[i * n + k] * K[j * n + k];
      if (i > j) K[i * n + j] = sum / K[j * n + j];
      else if (sum > 0) K[i * n + j] = Math.sqrt(sum);
      else return false;
    }
  }
  return true;
}

// Solve L L^T x = b in place.
function substitute(L, n, x) {
  for (let i = 0; i < n; i += 1) {
    for (let k = 0; k < i; k += 1) x[i] -= L[i * n + k] * x[k];
    x[i] /= L[i * n + i];
  }
  for (let i = n - 1; i >= 0; i -= 1) {
    for (let k = i + 1; k < n; k += 1) x[i] -= L[k * n + i] * x[k];
    x[i] /= L[i * n + i];
  }
}

class ReducedBody {
  constructor(packed) {
    this.dofs = packed.dofs;
    // Gradients of the coordinates in the cells: (cells, dofs, 9).
    for (const name of ["gradients", "weights", "lam", "mu", "springs"]) this[name] = unpack(packed[name], Float64Array);
    this.cells = this.weights.length;
    this.stiffness = 1; // what all moduli are multiplied by
    this.grip = null; // {rows: three rows of the basis, target: [m], stiffness: [N/m]}
    const n = this.dofs;
    this.K = new Float64Array(n * n);
    this.g = new Float64Array(n);
    this.A = new Float64Array(81);
    this.AD = new Float64Array(9 * n);
    [this.H, this.F, this.C, this.D] = [0, 1, 2, 3].map(() => new Float64Array(9));
    this.rest();
  }
  rest() {
    this.q = new Float64Array(this.dofs);
    this.v = new Float64Array(this.dofs);
    this.before = null; // {q, v} a step of `dt` earlier
    this.dt = 0;
  }
  // Force on the coordinates into g, and its derivative into the lower half of K.
  elastic() {
    const { dofs: n, K, g, q, springs } = this;
    for (let a = 0; a < n; a += 1) {
      let sum = 0;
      for (let b = 0; b < n; b += 1) {
        sum += springs[a * n + b] * q[b];
        K[a * n + b] = springs[a * n + b];
      }
      g[a] = sum;
    }
    for (let c = 0; c < this.cells; c += 1) this.addCell(c);
  }
  addCell(c) {
    const { dofs: n, gradients: G, q, g, H, F, C, D, A } = this, first = 9 * n * c, end = first + 9 * n;
    const weight = this.weights[c] * this.stiffness, mu = weight * this.mu[c], bulk = weight * (this.lam[c] + this.mu[c]);
    H.fill(0);
    for (let at = first, a = 0; at < end; at += 9, a += 1) for (let e = 0; e < 9; e += 1) H[e] += G[at + e] * q[a];
    // cof F - 1 and det F - 1 from H = F - 1: small strains keep their digits.
    cofactor(H, C);
    const trace = H[0] + H[4] + H[8];
    for (let i = 0; i < 3; i += 1) for (let j = 0; j < 3; j += 1) D[3 * i + j] = C[3 * i + j] - H[3 * j + i] + (i === j ? trace : 0);
    const grow = trace + C[0] + C[4] + C[8] + (H[0] * C[0] + H[1] * C[1] + H[2] * C[2]);
    for (let e = 0; e < 9; e += 1) {
      const one = e % 4 === 0 ? 1 : 0;
      C[e] = mu * H[e] + bulk * grow * (one + D[e]) - mu * D[e]; // stress
      F[e] = one + H[e];
      D[e] += one;
    }
    for (let at = first, a = 0; at < end; at += 9, a += 1) {
      let sum = 0;
      for (let e = 0; e < 9; e += 1) sum += C[e] * G[at + e];
      g[a] += sum;
    }
    for (let e = 0; e < 9; e += 1) for (let f = 0; f < 9; f += 1) A[9 * e + f] = bulk * D[e] * D[f] + (e === f ? mu : 0);
    const slope = bulk * grow - mu;
    for (const [k, l, m, s] of SKEW) for (const [i, j, o, t] of SKEW) A[9 * (3 * k + i) + 3 * l + j] += slope * s * t * F[3 * m + o];
    this.pullTangent(first);
  }
  // Lower half of K += G A G^T with the gradients G (dofs, 9) of a cell; written out, it takes half the time.
  pullTangent(first) {
    const { dofs: n, gradients: G, K, A, AD } = this;
    for (let a = 0; a < n; a += 1) {
      const at = first + 9 * a, to = 9 * a;
      for (let e = 0; e < 9; e += 1) {
        const r = 9 * e;
        AD[to + e] = A[r] * G[at] + A[r + 1] * G[at + 1] + A[r + 2] * G[at + 2] + A[r + 3] * G[at + 3] + A[r + 4] * G[at + 4]
          + A[r + 5] * G[at + 5] + A[r + 6] * G[at + 6] + A[r + 7] * G[at + 7] + A[r + 8] * G[at + 8];
      }
      const g0 = G[at], g1 = G[at + 1], g2 = G[at + 2], g3 = G[at + 3], g4 = G[at + 4], g5 = G[at + 5], g6 = G[at + 6], g7 = G[at + 7], g8 = G[at + 8];
      for (let b = 0, from = 0; b <= a; b += 1, from += 9) {
        K[a * n + b] += g0 * AD[from] + g1 * AD[from + 1] + g2 * AD[from + 2] + g3 * AD[from + 3] + g4 * AD[from + 4]
          + g5 * AD[from + 5] + g6 * AD[from + 6] + g7 * AD[from + 7] + g8 * AD[from + 8];
      }
    }
  }
  // The spring between hand and body: three terms of rank one.
  addGrip() {
    if (!this.grip) return;
    const { dofs: n, K, g, q } = this, { rows, target, stiffness } = this.grip;
    rows.forEach((row, axis) => {
      let u = 0;
      for (let a = 0; a < n; a += 1) u += row[a] * q[a];
      for (let a = 0; a < n; a += 1) {
        g[a] += stiffness * (u - target[axis]) * row[a];
        for (let b = 0; b <= a; b += 1) K[a * n + b] += stiffness * row[a] * row[b];
      }
    });
  }
  // Displacement [m] of what has these rows of the basis.
  displacement(rows) {
    return rows.map((row) => row.reduce((sum, value, a) => sum + value * this.q[a], 0));
  }
  // How far 1 N moves what has these rows of the basis, at most: [m/N].
  compliance(rows) {
    const kept = this.q, n = this.dofs;
    this.q = new Float64Array(n);
    this.elastic();
    this.q = kept;
    if (!factorise(this.K, n)) return 0;
    return Math.max(...rows.map((row) => {
      const x = Float64Array.from(row);
      substitute(this.K, n, x);
      return x.reduce((sum, value, a) => sum + value * row[a], 0);
    }));
  }
  // A step of dt [s]; one that fails is made of two halves.
  step(dt, halvings = MOST_HALVINGS) {
    const past = { q: this.q, v: this.v }, before = this.dt === dt ? this.before : null;
    if (this.newton(dt, past, before)) {
      [this.before, this.dt] = [past, dt];
      return true;
    }
    Object.assign(this, past, { before: null, dt: 0 });
    if (halvings === 0) {
      this.v = new Float64Array(this.dofs); // better still than torn: it goes on from here
      return false;
    }
    const first = this.step(dt / 2, halvings - 1), second = this.step(dt / 2, halvings - 1);
    return first && second;
  }
  // BDF2, or implicit Euler without a past; false where a Hessian is not positive or nothing is gained.
  newton(dt, { q, v }, before) {
    const n = this.dofs, factor = before ? 9 / (4 * dt * dt) : 1 / (dt * dt);
    const ahead = before
      ? q.map((x, a) => (4 * x - before.q[a]) / 3 + ((2 * dt) / 9) * (4 * v[a] - before.v[a]))
      : q.map((x, a) => x + dt * v[a]);
    this.q = Float64Array.from(ahead);
    let last = Infinity;
    for (let round = 0; round < NEWTON; round += 1) {
      this.elastic();
      this.addGrip();
      let size = 0;
      for (let a = 0; a < n; a += 1) {
        this.g[a] += factor * (this.q[a] - ahead[a]);
        this.K[a * n + a] += factor;
        size += this.g[a] * this.g[a];
      }
      if (!(size < last) && size > 0 && round > 0 && !this.still(size, factor, ahead)) return false;
      if (!factorise(this.K, n)) return false;
      substitute(this.K, n, this.g);
      for (let a = 0; a < n; a += 1) this.q[a] -= this.g[a];
      last = size;
    }
    this.v = before
      ? this.q.map((x, a) => (3 * x - 4 * q[a] + before.q[a]) / (2 * dt))
      : this.q.map((x, a) => (x - q[a]) / dt);
    return this.q.every(Number.isFinite);
  }
  // Whether a residual is round-off of the inertial force.
  still(size, factor, ahead) {
    return size <= 1e-18 * factor * factor * ahead.reduce((sum, x) => sum + x * x, 0);
  }
}
