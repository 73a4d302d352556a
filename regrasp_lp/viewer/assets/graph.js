// The page of a switching graph. Sets are numbered as in the graph; all arrays are padded to three
// contacts. What is not in the data is computed from the torque functions of a set.

const outline = new Outline(DATA.object);
const show = { cones: true, regions: true, focus: true, edges: outline.edges.length <= 30 };

// --- the data ---

const TYPES = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i2: Int16Array, f4: Float32Array, f8: Float64Array };

// Little-endian, as the browsers of today are.
function unpack({ type, data }) {
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  return new TYPES[type](bytes.buffer);
}

const edges = unpack(DATA.edges), centers = unpack(DATA.centers), margins = unpack(DATA.margins);
const witnesses = unpack(DATA.witnesses), functions = unpack(DATA.functions), rays = unpack(DATA.rays);
const limits = DATA.limits && unpack(DATA.limits);
const pieceStarts = DATA.pieces && unpack(DATA.pieces.starts), pieceColumns = DATA.pieces && unpack(DATA.pieces.columns);
const positions = unpack(DATA.positions), components = unpack(DATA.components);
const starts = unpack(DATA.starts), others = unpack(DATA.others), slots = unpack(DATA.slots), points = unpack(DATA.points);
const N = margins.length;
const kindOf = new Uint8Array(N);
DATA.kinds.reduce((offset, kind, k) => (kindOf.fill(k, offset, offset + kind.count), offset + kind.count), 0);
const nComponents = components.reduce((most, c) => Math.max(most, c + 1), 0);
const kind = (i) => DATA.kinds[kindOf[i]];
const size = (i) => kind(i).contacts;
const free = (i, j) => DATA.free.some(([a, b]) => a === size(i) && b === size(j));
const edgesOf = (i) => Array.from(edges.subarray(3 * i, 3 * i + size(i)));
const witnessOf = (i) => Array.from(witnesses.subarray(3 * i, 3 * i + size(i)));
const limitsOf = (i) => edgesOf(i).map((_, c) => (limits ? [limits[6 * i + 2 * c], limits[6 * i + 2 * c + 1]] : [0, 1]));

// Pairs i < j are listed once; here those seen from j, as rows of entries.
const back = (() => {
  const first = new Uint32Array(N + 1), owner = new Uint32Array(others.length), entry = new Uint32Array(others.length);
  for (const j of others) first[j + 1] += 1;
  for (let i = 0; i < N; i += 1) first[i + 1] += first[i];
  const at = first.slice();
  for (let i = 0; i < N; i += 1) {
    for (let e = starts[i]; e < starts[i + 1]; e += 1) {
      owner[at[others[e]]] = i;
      entry[at[others[e]]] = e;
      at[others[e]] += 1;
    }
  }
  return { first, owner, entry };
})();

// Calls with each set that a set shares held contacts with, and the entry of the pair.
function eachListed(i, call) {
  for (let n = back.first[i]; n < back.first[i + 1]; n += 1) call(back.owner[n], back.entry[n]);
  for (let e = starts[i]; e < starts[i + 1]; e += 1) call(others[e], e);
}

const bits = [0, 1, 1, 2, 1, 2, 2, 3];
const heldAt = (entry) => bits[slots[entry] & 7];

function entryOf(i, j) {
  const [low, high] = [Math.min(i, j), Math.max(i, j)];
  for (let e = starts[low]; e < starts[low + 1]; e += 1) if (others[e] === high) return e;
  return -1;
}

// All adjacent sets, ascending, with how many contacts the switch can hold.
function neighbors(i) {
  const found = new Map();
  eachListed(i, (j, e) => found.set(j, heldAt(e)));
  for (let j = 0; j < N; j += 1) if (j !== i && free(i, j) && !found.has(j)) found.set(j, 0);
  return [...found].sort((a, b) => a[0] - b[0]);
}

// --- torque functions: [M(0)/s, slopes] of each, over fractions of edges ---

function functionsOf(i) {
  const found = [];
  for (let n = 0; n < DATA.width; n += 1) {
    const at = 4 * (i * DATA.width + n);
    if (!Number.isNaN(functions[at])) found.push(Array.from(functions.subarray(at, at + 4)));
    else found.push(null);  // pieces name columns
  }
  return found;
}

const valueOf = (f, at) => at.reduce((sum, x, c) => sum + f[c + 1] * x, f[0]);

// The margin of a grasp: min(max v, -min v).
function marginOf(i, at) {
  const values = functionsOf(i).filter(Boolean).map((f) => valueOf(f, at));
  return Math.min(Math.max(...values), -Math.min(...values));
}

// Where contact c may be, given those at numbers; the others (null) may be anywhere.
function interval(i, at, c) {
  const box = limitsOf(i);
  let low = Infinity, high = -Infinity;
  for (const f of functionsOf(i).filter(Boolean)) {
    const value = (end) => f[0] + at.reduce((sum, x, d) => (d === c ? sum : sum + f[d + 1] * (x ?? box[d][end])), 0);
    const [below, above] = [value(0), value(1)], slope = f[c + 1];
    high = Math.max(high, slope > 0 ? -below / slope : below < 0 ? 2 : -1);
    low = Math.min(low, slope > 0 ? -above / slope : above > 0 ? -1 : 2);
  }
  return [Math.max(low, box[c][0]), Math.min(high, box[c][1])].map((x) => Math.max(box[c][0], Math.min(box[c][1], x)));
}

// A grasp with given contacts (null where they are free): each free one in the middle of where it
// may be, one after the other.
function completed(i, at) {
  const found = at.slice();
  for (let c = 0; c < found.length; c += 1) {
    if (found[c] === null) {
      const [low, high] = interval(i, found, c);
      found[c] = (low + high) / 2;
    }
  }
  return found;
}

// The two grasps of a switch, equal in the contacts that it holds, and which these are.
function switchOf(i, j) {
  const e = entryOf(i, j), swapped = i > j;
  const masks = e < 0 ? [0, 0] : [slots[e] & 7, slots[e] >> 3];
  const [mine, theirs] = swapped ? [masks[1], masks[0]] : masks;
  const known = (mask, n) => {
    const at = Array(n).fill(null);
    let next = 0;
    for (let c = 0; c < n; c += 1) if (mask & (1 << c)) at[c] = points[DATA.most_held * e + next++];
    return at;
  };
  const of = (k, mask) => (DATA.spaced ? witnessOf(k) : completed(k, known(mask, size(k))));
  const chosen = (mask, n) => Array.from({ length: n }, (_, c) => c).filter((c) => mask & (1 << c));
  return { held: bits[mine], leaving: of(i, mine), arriving: of(j, theirs),
    heldLeaving: chosen(mine, size(i)), heldArriving: chosen(theirs, size(j)) };
}

// --- pieces: {M_j < 0 < M_k} in the box, two contacts on one edge in order ---

// First and last value of each contact over a piece: those of its corners. Null if it has none.
function pieceIntervals(i, [j, k]) {
  const list = functionsOf(i), m = size(i), on = edgesOf(i), planes = [];
  const row = (coefficients, bound) => planes.push([coefficients, bound]);  // coefficients · u <= bound
  row(list[j].slice(1, m + 1), -list[j][0]);
  row(list[k].slice(1, m + 1).map((x) => -x), list[k][0]);
  const unit = (c, s) => Array.from({ length: m }, (_, d) => (d === c ? s : 0));
  limitsOf(i).forEach(([low, high], c) => { row(unit(c, 1), high); row(unit(c, -1), -low); });
  on.forEach((edge, c) => { if (edge === on[c + 1]) row(unit(c, 1).map((x, d) => (d === c + 1 ? -1 : x)), 0); });
  const scale = planes.map(([a]) => Math.max(...a.map(Math.abs), 1e-300));
  let found = null;
  for (const chosen of choices(planes.length, m)) {
    const corner = solved(chosen.map((n) => planes[n]), m);
    if (!corner) continue;
    const inside = planes.every(([a, b], n) => a.reduce((sum, x, c) => sum + x * corner[c], -b) <= 1e-9 * scale[n]);
    if (inside) found = corner.map((x, c) => (found ? [Math.min(found[c][0], x), Math.max(found[c][1], x)] : [x, x]));
  }
  return found;
}

function choices(n, m) {
  const found = [];
  const extend = (chosen, from) => {
    if (chosen.length === m) found.push(chosen);
    else for (let k = from; k < n; k += 1) extend([...chosen, k], k + 1);
  };
  extend([], 0);
  return found;
}

// By Cramer's rule; null if the planes do not meet in one point.
function solved(rows, m) {
  const det = (a) => (m === 2 ? a[0][0] * a[1][1] - a[0][1] * a[1][0]
    : a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) + a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]));
  const matrix = rows.map(([a]) => a), whole = det(matrix);
  const norm = matrix.reduce((product, a) => product * Math.hypot(...a), 1);
  if (Math.abs(whole) <= 1e-12 * norm) return null;
  return rows.map((_, c) => det(matrix.map((a, r) => a.map((x, d) => (d === c ? rows[r][1] : x)))) / whole);
}

const piecesOf = (i) => (DATA.pieces ? Array.from({ length: pieceStarts[i + 1] - pieceStarts[i] },
  (_, n) => Array.from(pieceColumns.subarray(2 * (pieceStarts[i] + n), 2 * (pieceStarts[i] + n) + 2))) : []);

// Over the whole set: from the least to the largest over its pieces, for it is connected.
function setIntervals(i) {
  return piecesOf(i).map((piece) => pieceIntervals(i, piece)).filter(Boolean)
    .reduce((all, one) => (all ? all.map(([low, high], c) => [Math.min(low, one[c][0]), Math.max(high, one[c][1])]) : one), null);
}

// --- paths: fewest placements, then the largest least margin, then the sets with smaller numbers ---

// Dijkstra's algorithm on labels (placements, less the least margin), as the planner's.
function path(from, to) {
  const placements = new Int32Array(N).fill(2 ** 30), least = new Float64Array(N).fill(-Infinity), before = new Int32Array(N).fill(-1);
  const queue = new Heap();
  const relax = (node, j, cost, margin) => {
    if (margin === -Infinity || cost > placements[j] || (cost === placements[j] && margin <= least[j])) return;
    placements[j] = cost;
    least[j] = margin;
    before[j] = node;
    queue.push([cost, -margin, j]);
  };
  const freely = [2, 3].map((n) => [n, Array.from({ length: N }, (_, i) => i).filter((i) => size(i) === n)]);
  const listed = new Int32Array(N).fill(-1);
  relax(-1, from, 0, margins[from]);
  for (let item = queue.pop(); item; item = queue.pop()) {
    const [cost, negative, node] = item;
    if (cost !== placements[node] || -negative !== least[node]) continue;
    if (node === to) break;
    eachListed(node, (j, e) => {
      listed[j] = node;
      relax(node, j, cost + size(j) - heldAt(e), Math.min(-negative, margins[j]));
    });
    for (const [n, those] of freely) {
      if (!DATA.free.some(([a, b]) => a === size(node) && b === n)) continue;
      for (const j of those) if (j !== node && listed[j] !== node) relax(node, j, cost + n, Math.min(-negative, margins[j]));
    }
  }
  if (least[to] === -Infinity) return null;
  const sets = [];
  for (let node = to; node >= 0; node = before[node]) sets.unshift(node);
  return { sets, placements: placements[to], margin: least[to] };
}

class Heap {
  constructor() { this.items = []; }

  static less(a, b) {
    for (let n = 0; n < 3; n += 1) if (a[n] !== b[n]) return a[n] < b[n];
    return false;
  }

  push(item) {
    const { items } = this;
    let n = items.push(item) - 1;
    while (n && Heap.less(item, items[(n - 1) >> 1])) {
      items[n] = items[(n - 1) >> 1];
      n = (n - 1) >> 1;
    }
    items[n] = item;
  }

  pop() {
    const { items } = this;
    if (items.length < 2) return items.pop();
    const top = items[0], last = items.pop();
    let n = 0;
    for (;;) {
      let child = 2 * n + 1;
      if (child >= items.length) break;
      if (child + 1 < items.length && Heap.less(items[child + 1], items[child])) child += 1;
      if (!Heap.less(items[child], last)) break;
      items[n] = items[child];
      n = child;
    }
    items[n] = last;
    return top;
  }
}

// --- what is chosen ---

const state = { from: null, to: null, way: null, at: 0, grasp: null, piece: -1, cursor: null, hovered: null };
const filter = { kinds: new Set(DATA.kinds.map((_, k) => k)), edges: [], least: -Infinity };
const passes = (i) => filter.kinds.has(kindOf[i]) && margins[i] >= filter.least && filter.edges.every((e) => edgesOf(i).includes(e));

function choose(i) {
  if (state.from === null || state.to !== null) select(i, null);
  else if (i === state.from) select(null, null);
  else select(state.from, i);
}

function select(from, to = null) {
  Object.assign(state, { from, to, at: 0, piece: -1, way: to === null || from === null ? null : path(from, to) });
  state.grasp = from === null ? null : witnessOf(from);
  byId("from").value = from ?? "";
  byId("to").value = to ?? "";
  byId("refused").textContent = "";
  if (from !== null) state.cursor = to ?? from;
  describe();
  render();
}

// --- the map ---

const canvas = byId("canvas"), context = canvas.getContext("2d");
const bounds = [0, 1].map((axis) => {
  let [low, high] = [Infinity, -Infinity];
  for (let i = 0; i < N; i += 1) {
    low = Math.min(low, positions[2 * i + axis]);
    high = Math.max(high, positions[2 * i + axis]);
  }
  return N ? [low, high] : [0, 1];
});
let camera = { scale: 1, x: 0, y: 0 }, pixels = [0, 0], ratio = 1, busy = 0, colors = {};

const BORDER = 20, BUTTONS = 44;  // around the points, and for the buttons on the right of them

function fit() {
  const scale = baseScale(), middle = (pixels[0] - BUTTONS) / 2;
  camera = { scale, x: middle - scale * (bounds[0][0] + bounds[0][1]) / 2, y: pixels[1] / 2 + scale * (bounds[1][0] + bounds[1][1]) / 2 };
}

const onMap = (i) => [camera.x + camera.scale * positions[2 * i], camera.y - camera.scale * positions[2 * i + 1]];

function measure() {
  ratio = devicePixelRatio || 1;
  const width = canvas.parentElement.clientWidth, aspect = (bounds[1][1] - bounds[1][0]) / Math.max(bounds[0][1] - bounds[0][0], 1e-9);
  const wanted = Math.min(width * Math.max(0.55, aspect), innerHeight * 0.62);
  const height = Math.max(240, seenWhole() ? roomFor(canvas, byId(byId("refused").textContent ? "choice" : "hint")) : wanted);
  canvas.style.height = `${height}px`;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  pixels = [width, height];
  const style = getComputedStyle(document.documentElement);
  colors = Object.fromEntries(["paper", "ink", "blue", "vermillion", "sky", "set", "grey", "accent", "orange"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

const kindColors = () => ({ "two-finger": colors.vermillion, parallel: colors.set, concurrent: colors.accent, "three-finger": colors.accent });

let pending = false;
function render() {
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => { pending = false; paint(); });
}

function paint() {
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = colors.paper;
  context.fillRect(0, 0, ...pixels);
  const seen = Uint8Array.from({ length: N }, (_, i) => passes(i));
  // while it is moved all lines are too many
  if (byId("switches").checked && !busy) strokeAll(seen);
  if (state.from !== null && !state.way) {
    const near = neighbors(state.from).map(([j]) => j);
    strokePairs(near.filter((j) => seen[j]).map((j) => [state.from, j]), colors.accent, near.length > 400 ? 0.12 : 0.35, 1);
  }
  marks(seen);
  if (state.way) {
    strokePairs(state.way.sets.slice(1).map((j, n) => [state.way.sets[n], j]), colors.vermillion, 1, 3);
    state.way.sets.forEach((i) => mark(i, radius() + 2, kindColors()[kind(i).name]));
  }
  numbers(seen);
  for (const [i, name] of [[state.from, "from"], [state.to, "to"]]) if (i !== null) flag(i, state.to === null ? `set ${i}` : `${name} ${i}`);
  if (state.hovered !== null) flag(state.hovered, `set ${state.hovered}: edges ${edgesOf(state.hovered).join(", ")}`);
  if (document.activeElement === canvas && state.cursor !== null) ring(state.cursor, radius() + 6, colors.ink);
}

const radius = () => Math.max(2, Math.min(7, 0.35 * Math.sqrt(pixels[0] * pixels[1] / Math.max(N, 1)) * Math.sqrt(camera.scale / baseScale())));
const baseScale = () => Math.min(...[pixels[0] - BUTTONS, pixels[1]].map((side, axis) => (side - 2 * BORDER) / Math.max(bounds[axis][1] - bounds[axis][0], 1e-9)));

function strokePairs(pairs, color, alpha, width) {
  context.globalAlpha = alpha;
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  for (const [i, j] of pairs) {
    context.moveTo(...onMap(i));
    context.lineTo(...onMap(j));
  }
  context.stroke();
  context.globalAlpha = 1;
}

function strokeAll(seen) {
  const pairs = [];
  const skip = Math.ceil(others.length / 60000);  // beyond that one sees no more
  for (let i = 0; i < N; i += 1) {
    for (let e = starts[i]; e < starts[i + 1]; e += 1) if (e % skip === 0 && seen[i] && seen[others[e]]) pairs.push([i, others[e]]);
  }
  strokePairs(pairs, colors.ink, Math.max(0.04, Math.min(0.35, 7 / Math.sqrt(Math.max(pairs.length, 1)))), 0.7);
}

function marks(seen) {
  const r = radius(), paints = kindColors();
  for (const shown of [0, 1]) {
    context.globalAlpha = shown ? 1 : 0.12;
    DATA.kinds.forEach((one, k) => {
      context.fillStyle = paints[one.name];
      context.beginPath();
      for (let i = 0; i < N; i += 1) if (kindOf[i] === k && seen[i] === shown) shape(i, r);
      context.fill();
    });
  }
  context.globalAlpha = 1;
}

// A disc, a triangle or a square, by the kind of the set.
function shape(i, r) {
  const [x, y] = onMap(i), { marker } = kind(i);
  if (x < -r || y < -r || x > pixels[0] + r || y > pixels[1] + r) return;
  if (marker === "s") context.rect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r);
  else if (marker === "^") {
    context.moveTo(x, y - 1.3 * r);
    context.lineTo(x + 1.2 * r, y + r);
    context.lineTo(x - 1.2 * r, y + r);
    context.closePath();
  } else {
    context.moveTo(x + r, y);
    context.arc(x, y, r, 0, 2 * Math.PI);
  }
}

function mark(i, r, color) {
  context.fillStyle = color;
  context.strokeStyle = colors.ink;
  context.lineWidth = 1.5;
  context.beginPath();
  shape(i, r);
  context.fill();
  context.stroke();
}

function ring(i, r, color) {
  context.strokeStyle = color;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(...onMap(i), r, 0, 2 * Math.PI);
  context.stroke();
}

const NUMBERED = 60;  // so many points in view have their numbers beside them

// Beside each point, where it covers neither a point nor another number.
function numbers(seen) {
  const inView = [];
  for (let i = 0; i < N && inView.length <= NUMBERED; i += 1) {
    const [x, y] = onMap(i);
    if (seen[i] && x > 0 && y > 0 && x < pixels[0] && y < pixels[1]) inView.push(i);
  }
  if (inView.length > NUMBERED) return;
  const r = 1.2 * radius(), taken = inView.map((i) => [...onMap(i), r, r]);
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.strokeStyle = colors.paper;
  context.fillStyle = colors.ink;
  context.lineWidth = 3;
  const flagged = [state.from, state.to, state.hovered];
  for (const i of inView) {
    if (flagged.includes(i)) continue;
    const [x, y] = onMap(i), half = [context.measureText(i).width / 2 + 1, 5.5];
    const place = BESIDE.map(([dx, dy]) => [x + dx * (r + half[0] + 1), y + dy * (r + half[1] + 1), ...half])
      .find((box) => box[0] > half[0] && box[0] < pixels[0] - half[0] && box[1] > half[1] && box[1] < pixels[1] - half[1]
        && taken.every((other) => Math.abs(box[0] - other[0]) > half[0] + other[2] || Math.abs(box[1] - other[1]) > half[1] + other[3]));
    if (!place) continue;  // it is told where one points at it
    taken.push(place);
    context.strokeText(i, place[0], place[1] + 4);
    context.fillText(i, place[0], place[1] + 4);
  }
  context.textAlign = "start";
}

const BESIDE = [[1, 0], [-1, 0], [0, -1], [0, 1], [0.8, -0.8], [-0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]];

function flag(i, words) {
  const [x, y] = onMap(i);
  mark(i, radius() + 3, kindColors()[kind(i).name]);
  context.font = "600 13px system-ui, sans-serif";
  const width = context.measureText(words).width, left = Math.max(2, Math.min(pixels[0] - BUTTONS - width - 12, x + 10)), top = Math.max(2, y - 26);
  context.fillStyle = colors.ink;
  context.fillRect(left, top, width + 10, 19);
  context.fillStyle = colors.paper;
  context.fillText(words, left + 5, top + 14);
}

function nearest([x, y], most) {
  let best = most ** 2, found = null;
  for (let i = 0; i < N; i += 1) {
    const [px, py] = onMap(i), d = (px - x) ** 2 + (py - y) ** 2;
    if (d < best && passes(i)) { best = d; found = i; }
  }
  return found;
}

function zoom(factor, [x, y] = [pixels[0] / 2, pixels[1] / 2]) {
  const to = Math.max(0.5 * baseScale(), Math.min(200 * baseScale(), camera.scale * factor)), by = to / camera.scale;
  camera = { scale: to, x: x + by * (camera.x - x), y: y + by * (camera.y - y) };
  moving();
}

// All lines come back once it stands still.
function moving() {
  clearTimeout(busy);
  busy = setTimeout(() => { busy = 0; render(); }, 160);
  render();
}

function hover(i) {
  if (state.hovered === i) return;
  state.hovered = i;
  render();
}

const held = new Map();
let dragged = 0;
const placeOf = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  held.set(event.pointerId, placeOf(event));
  if (held.size === 1) dragged = 0;
});
canvas.addEventListener("pointermove", (event) => {
  if (!held.has(event.pointerId)) {
    hover(nearest(placeOf(event), 12));
    return;
  }
  const old = held.get(event.pointerId), now = placeOf(event);
  const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
  const gap = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]);
  held.set(event.pointerId, now);
  dragged += gap(old, now);
  if (other) zoom(gap(now, other) / Math.max(gap(old, other), 1), mixed(now, other, 0.5));
  else if (dragged > 4) { camera.x += now[0] - old[0]; camera.y += now[1] - old[1]; moving(); }
});
canvas.addEventListener("pointerup", (event) => {
  held.delete(event.pointerId);
  if (dragged > 4 || held.size) return;
  const found = nearest(placeOf(event), event.pointerType === "touch" ? 24 : 12);
  if (found !== null) choose(found);
});
canvas.addEventListener("pointerleave", () => hover(null));
canvas.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-0.0015 * event.deltaY), placeOf(event)); }, { passive: false });
canvas.addEventListener("focus", render);
canvas.addEventListener("blur", render);

const ARROWS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] };

canvas.addEventListener("keydown", (event) => {
  if (event.altKey || event.ctrlKey || event.metaKey) return;
  if (ARROWS[event.key]) moveCursor(ARROWS[event.key]);
  else if ((event.key === "Enter" || event.key === " ") && state.cursor !== null) choose(state.cursor);
  else if (event.key === "Escape") select(null, null);
  else if (event.key === "+") zoom(1.4);
  else if (event.key === "-") zoom(1 / 1.4);
  else return;
  event.preventDefault();
});

// To the nearest point in a direction, farther off to the side counting more.
function moveCursor([dx, dy]) {
  const from = state.cursor === null ? [pixels[0] / 2, pixels[1] / 2] : onMap(state.cursor);
  let best = Infinity, found = null;
  for (let i = 0; i < N; i += 1) {
    if (i === state.cursor || !passes(i)) continue;
    const [x, y] = add(onMap(i), from, -1), ahead = x * dx + y * dy, aside = Math.abs(x * dy - y * dx);
    const cost = state.cursor === null ? Math.hypot(x, y) : ahead > 0.5 && aside <= 2 * ahead ? ahead + 2 * aside : Infinity;
    if (cost < best) { best = cost; found = i; }
  }
  if (found === null) return;
  state.cursor = found;
  const at = onMap(found);
  if (at.some((v, axis) => v < 10 || v > pixels[axis] - 10)) {
    camera.x += pixels[0] / 2 - at[0];
    camera.y += pixels[1] / 2 - at[1];
  }
  if (state.to === null) byId("now").textContent = named(found);
  render();
}

// --- words and pictures of what is chosen ---

const named = (i) => `set ${i}: ${kind(i).name} on edges ${edgesOf(i).join(", ")}${centers[i] >= 0 ? `, centre ${centers[i]}` : ""}, margin ${text(margins[i])}`;
const lengths = (i) => edgesOf(i).map((edge) => outline.edges[edge].length);
const letters = ["a", "b", "c"];

function describe() {
  const { from, to, way } = state;
  byId("more").replaceChildren();
  if (from === null) {
    byId("chosen").textContent = "Nothing is chosen";
    byId("now").textContent = "";
  } else if (to === null) describeSet(from);
  else describeWay(from, to, way);
  picture();
}

function describeSet(i) {
  byId("chosen").textContent = `Set ${i}: ${kind(i).name} on edges ${edgesOf(i).join(", ")}${centers[i] >= 0 ? `, centre ${centers[i]}` : ""}`;
  const list = piecesOf(i), near = neighbors(i);
  const head = make("tr", {}, ...["", "edge", "position", "from … to", ""].map((words) => make("th", { scope: "col" }, words)));
  const rows = edgesOf(i).map((edge, c) => contactRow(i, edge, c));
  const best = make("button", { type: "button", id: "best" }, "best grasp");
  best.addEventListener("click", () => { state.grasp = witnessOf(i); refresh(i); });
  const choice = make("select", { id: "piece", "aria-label": "Piece" }, make("option", { value: -1 }, `the whole set (${counted(list.length, "convex piece")})`),
    ...list.map(([j, k], n) => make("option", { value: n }, `piece ${n + 1}: M${j} < 0 < M${k}`)));
  choice.addEventListener("change", () => { state.piece = Number(choice.value); refresh(i); });
  const links = near.slice(0, 60).map(([j, h]) => link(j, `${j} (hold ${h})`, () => select(i, j)));
  byId("more").append(make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows)),
    make("p", { class: "links" }, best, ...(list.length ? [choice] : [])),
    make("h3", {}, `${counted(near.length, "neighbour")}${near.length > 60 ? ", the first 60" : ""}`), make("div", { class: "links" }, ...links));
  refresh(i);
}

function contactRow(i, edge, c) {
  const [low, high] = limitsOf(i)[c];
  const slider = make("input", { type: "range", min: low, max: high, step: "any", "aria-label": `Contact ${letters[c]} on edge ${edge}`, "data-contact": c });
  slider.addEventListener("input", () => { state.grasp[c] = Number(slider.value); refresh(i); });
  return make("tr", {}, make("th", { scope: "row" }, letters[c]), make("td", {}, String(edge)), make("td", { class: "position" }), make("td", { class: "allowed" }), make("td", {}, slider));
}

function link(j, words, call) {
  const button = make("button", { type: "button", title: named(j) }, words);
  button.addEventListener("click", call);
  return button;
}

// What changes with the grasp that is shown: numbers, sliders and the picture.
function refresh(i) {
  const spans = shownIntervals(i), scale = lengths(i);
  byId("more").querySelectorAll("tbody tr").forEach((row, c) => {
    row.querySelector(".position").textContent = text(state.grasp[c] * scale[c]);
    row.querySelector(".allowed").textContent = spans ? `${text(spans[c][0] * scale[c])} … ${text(spans[c][1] * scale[c])}` : "";
    row.querySelector("input").value = state.grasp[c];
  });
  const margin = marginOf(i, state.grasp);
  byId("now").replaceChildren(make("b", {}, margin > 0 ? `margin ${text(margin)}` : `no grasp of this set (margin ${text(margin)})`),
    ` · best of the set ${text(margins[i])}${nComponents > 1 ? ` · component ${components[i] + 1} of ${nComponents}` : ""}${DATA.spaced ? " · limits that tie fingers to each other are not looked at here" : ""}`);
  picture();
}

// Asked for again with every move of a slider.
let shown = {};
function shownIntervals(i) {
  if (shown.set !== i || shown.piece !== state.piece) {
    shown = { set: i, piece: state.piece, spans: state.piece < 0 ? setIntervals(i) : pieceIntervals(i, piecesOf(i)[state.piece]) };
  }
  return shown.spans;
}

function describeWay(from, to, way) {
  byId("chosen").textContent = `From set ${from} to set ${to}`;
  if (!way) {
    byId("now").textContent = "There is no way: they are in different components.";
    return;
  }
  byId("now").replaceChildren(make("b", {}, counted(way.placements, "placement")), `, ${counted(way.sets.length - 1, "switch")} · least margin of its sets ${text(way.margin)}`);
  const items = [make("li", {}, wayButton(0, `in ${named(from)}`, ""))];
  way.sets.slice(1).forEach((j, n) => {
    const one = switchOf(way.sets[n], j), on = edgesOf(way.sets[n]), held = one.heldLeaving.map((c) => on[c]);
    const words = held.length ? `hold edge${held.length > 1 ? "s" : ""} ${held.join(", ")}` : "hold nothing in common";
    items.push(make("li", {}, wayButton(n + 1, `to ${named(j)}`, `${words}, place ${size(j) - one.held}`)));
  });
  byId("more").append(make("ol", {}, ...items));
  markWay();
}

function wayButton(n, words, small) {
  const button = make("button", { type: "button" }, words, ...(small ? [make("br"), make("small", {}, small)] : []));
  button.addEventListener("click", () => { state.at = n; markWay(); picture(); });
  return button;
}

function markWay() {
  byId("more").querySelectorAll("ol button").forEach((button, n) => {
    if (n === state.at) button.setAttribute("aria-current", "step");
    else button.removeAttribute("aria-current");
  });
}

function picture() {
  const svg = byId("picture"), width = svg.clientWidth || svg.parentElement.clientWidth;
  const view = new View(outline, width, Math.max(200, Math.min(0.45 * innerHeight, width)));
  svg.setAttribute("height", view.height);
  drawScene(svg, view, sceneOf());
}

function sceneOf() {
  const { from, to, way, at } = state;
  if (from === null || (to !== null && !way)) return { contacts: {}, support: [], regions: {}, rays: {}, show };
  if (to === null) {
    const scene = graspScene(from, state.grasp), spans = shownIntervals(from);
    scene.wide = spans ? Object.fromEntries(spans.map((span, c) => [letters[c], span])) : {};
    if (!DATA.spaced) scene.regions = Object.fromEntries(state.grasp.map((_, c) => [letters[c], freely(from, c)]).filter(([, span]) => span[0] < span[1]));
    return scene;
  }
  if (at === 0) return graspScene(from, way.sets.length > 1 ? switchOf(from, way.sets[1]).leaving : witnessOf(from));
  return switchScene(way.sets[at - 1], way.sets[at]);
}

// Where a contact may be while the others stay.
const freely = (i, c) => interval(i, state.grasp.map((x, d) => (d === c ? null : x)), c);

function graspScene(i, grasp) {
  const on = edgesOf(i), keys = letters.slice(0, on.length);
  return { contacts: Object.fromEntries(keys.map((k, c) => [k, [on[c], grasp[c]]])), support: keys, regions: {}, rays: raysOf(i, keys),
    parallel: kind(i).parallel, cell: kind(i).cell, strong: [...new Set(on)], show };
}

// The common cone as each contact sees it.
function raysOf(i, keys) {
  const [a, b, c, d] = rays.subarray(4 * i, 4 * i + 4);
  if (Number.isNaN(a)) return {};
  const on = edgesOf(i), middle = centers[i] >= 0 ? centers[i] : on[0];
  return Object.fromEntries(keys.map((k, n) => { const s = on[n] === middle ? -1 : 1; return [k, [[s * a, s * b], [s * c, s * d]]]; }));
}

// A switch: the grasp that is reached, its new contacts marked, and in grey what is let go.
function switchScene(i, j) {
  const one = switchOf(i, j), scene = graspScene(j, one.arriving), on = edgesOf(i);
  scene.held = one.heldArriving.map((c) => letters[c]);
  scene.moved = scene.support.filter((k) => !scene.held.includes(k));
  const gone = one.leaving.map((f, c) => [c, [on[c], f]]).filter(([c]) => !one.heldLeaving.includes(c));
  scene.released = gone.map(([c]) => `old ${letters[c]}`);
  scene.names = Object.fromEntries(scene.released.map((name) => [name, "–"]));
  scene.contacts = { ...scene.contacts, ...Object.fromEntries(gone.map(([c, contact]) => [`old ${letters[c]}`, contact])) };
  return scene;
}

// --- the page ---

function filtered() {
  filter.edges = (byId("on-edges").value.match(/\d+/g) ?? []).map(Number);
  const least = Number(byId("least").value.replace(",", "."));
  filter.least = byId("least").value.trim() && Number.isFinite(least) ? least : -Infinity;
  let count = 0;
  for (let i = 0; i < N; i += 1) count += passes(i);
  byId("shown").textContent = count === N ? "" : `${counted(count, "set")} of ${N.toLocaleString("en-US")}`;
  render();
}

function kindBoxes() {
  byId("kinds").replaceChildren(...DATA.kinds.map((one, k) => {
    const box = make("input", { type: "checkbox", checked: true, "data-kind": one.name });
    box.addEventListener("change", () => { filter.kinds[box.checked ? "add" : "delete"](k); filtered(); });
    const color = { "two-finger": "vermillion", parallel: "set" }[one.name] ?? "accent";
    const signs = { s: "M1 1h10v10H1z", "^": "M6 0l6 11H0z", o: "M6 0a6 6 0 1 0 .01 0z" };
    const sign = draw("svg", { width: 12, height: 12, "aria-hidden": "true" }, draw("path", { d: signs[one.marker], fill: `var(--${color})` }));
    return make("label", { class: "sign-box" }, box, sign, `${one.count.toLocaleString("en-US")} ${one.name}`);
  }));
}

function typed() {
  const numbers = ["from", "to"].map((id) => byId(id).value.trim());
  const refused = refusal(numbers);
  if (refused) byId("refused").textContent = refused;  // what is typed stays, and what is chosen
  else select(...numbers.map((number) => (number === "" ? null : Number(number))));
}

// What is wrong with the numbers of two sets as they were typed; nothing is an empty text.
function refusal([from, to]) {
  if (["from", "to"].some((id) => byId(id).validity.badInput)) return "That is not the number of a set.";
  const unknown = [from, to].find((number) => number !== "" && !(/^\d+$/.test(number) && Number(number) < N));
  if (unknown !== undefined) return N ? `There is no set ${unknown}: they are numbered from 0 to ${N - 1}.` : "There are no sets.";
  if (from === "" && to !== "") return "Type the number of the first set, too.";
  return from !== "" && Number(from) === Number(to) && to !== "" ? "These two are the same set." : "";
}

function resized() {
  measure();
  fit();
  picture();
  render();
}

byId("facts").textContent = [counted(N, "set"), counted(DATA.n_switches, "switch"), counted(nComponents, "component"), counted(DATA.fingers, "finger")].join(" · ");
for (const id of ["from", "to"]) {
  byId(id).max = N - 1;
  byId(id).addEventListener("change", typed);
}
for (const id of ["on-edges", "least"]) byId(id).addEventListener("input", filtered);
byId("filters").addEventListener("submit", (event) => event.preventDefault());
byId("clear").addEventListener("click", () => select(null, null));
byId("switches").checked = others.length <= 5000;
byId("switches").addEventListener("change", render);
byId("zoom-in").addEventListener("click", () => zoom(1.5));
byId("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
byId("zoom-all").addEventListener("click", () => { fit(); render(); });
kindBoxes();
layerBoxes([["cones", "cone", "friction cones"], ["regions", "region", "where it may be (wide: in the set; narrow: as the others are)"],
  ["focus", "focus", "focus points", ...(DATA.kinds.some((one) => one.cell) ? ["cell", "focus cell"] : [])], ["edges", null, "edge numbers"]],
  [["dot supports", "contact"], ["dot moved", "placed"], ["dot released", "let go"]], show, picture);
select(null, null);
resized();
onResize(resized);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { measure(); render(); });

// For whoever looks under the hood, and for tests.
globalThis.regrasp = { state, select, choose, path, neighbors, switchOf, marginOf, pieceIntervals, setIntervals, piecesOf, completed, onMap, outline };
