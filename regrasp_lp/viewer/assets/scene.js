// What all pages share: the data, numbers as text, the object, and the picture of a grasp on it.

const DATA = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const FINGER = 10;  // radius of a finger's circle, in pixels
const PAD = 42;  // room around the object for fingers and numbers

// --- numbers and elements ---

// As everywhere in the package: four digits that mean something, a point for the decimals.
function text(value, digits = 4) {
  return value === null || !Number.isFinite(value) ? "−∞" : String(Number(value.toPrecision(digits)));
}

const counted = (n, word) =>
  `${n.toLocaleString("en-US")} ${word}${n === 1 ? "" : word.endsWith("ch") ? "es" : "s"}`;

// An element with attributes and children; strings become text, never markup.
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  return dressed(element, attributes, children);
}

function draw(tag, attributes = {}, ...children) {
  return dressed(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function dressed(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

// --- vectors ---

const add = (p, q, s = 1) => [p[0] + s * q[0], p[1] + s * q[1]];
const cross = (p, q) => p[0] * q[1] - p[1] * q[0];
const unit = (p) => [p[0] / Math.hypot(...p), p[1] / Math.hypot(...p)];
const mix = (a, b, s) => a + s * (b - a);
const mixed = (p, q, s) => [mix(p[0], q[0], s), mix(p[1], q[1], s)];

// --- the object ---

// Edges run through the rings as stored, counter-clockwise along the outline.
class Outline {
  constructor({ rings, friction }) {
    this.rings = rings;
    this.edges = rings.flatMap((ring) => ring.map((p, i) => {
      const q = ring[(i + 1) % ring.length];
      const length = Math.hypot(q[0] - p[0], q[1] - p[1]);
      const along = [(q[0] - p[0]) / length, (q[1] - p[1]) / length];
      return { start: p, end: q, length, along, inward: [-along[1], along[0]] };
    }));
    this.edges.forEach((edge, i) => { edge.friction = friction[i]; });
    const xs = rings[0].map((p) => p[0]), ys = rings[0].map((p) => p[1]);
    this.low = [Math.min(...xs), Math.min(...ys)];
    this.high = [Math.max(...xs), Math.max(...ys)];
    this.size = Math.hypot(this.high[0] - this.low[0], this.high[1] - this.low[1]);
  }

  at([edge, fraction]) {
    return mixed(this.edges[edge].start, this.edges[edge].end, fraction);
  }

  // The clockwise and the counter-clockwise boundary of a friction cone: n + μ t and n - μ t.
  rays(edge) {
    const { along, inward, friction } = this.edges[edge];
    return [add(inward, along, friction), add(inward, along, -friction)];
  }
}

// --- convex regions, as polygons ---

// The part of a convex polygon where normal · q >= offset.
function clip(polygon, [normal, offset]) {
  const value = polygon.map((q) => normal[0] * q[0] + normal[1] * q[1] - offset);
  return polygon.flatMap((q, i) => {
    const j = (i + 1) % polygon.length;
    const kept = value[i] >= 0 ? [q] : [];
    if ((value[i] > 0 && value[j] < 0) || (value[i] < 0 && value[j] > 0)) {
      kept.push(mixed(q, polygon[j], value[i] / (value[i] - value[j])));
    }
    return kept;
  });
}

// {q : r × (q - p) >= 0}, and the same with the sign of s.
const leftOf = (p, r, s = 1) => [[-s * r[1], s * r[0]], s * cross(r, p)];

// Where a segment of an edge sees q through its cone, on the side s of it: E ⊕ s C.
function sweep(a, b, along, [right, left], s) {
  const [first, last] = s > 0 ? [b, a] : [a, b];
  return [leftOf(a, along, s), leftOf(first, right, s), leftOf(last, left, -s)];
}

function area(polygon) {
  return polygon.reduce((sum, p, i) => sum + cross(p, polygon[(i + 1) % polygon.length]), 0) / 2;
}

// Convex polygons whose union is all q that each part sees through its cone. A part is a segment
// {a, b, along, rays}; of two, both on the same side; of three, on any side each. With `balanced`,
// of three contacts only those q at which forces through q can balance: (q - p_i) × (q - p_j) is
// linear in q.
function focusRegions(parts, box, balanced = false) {
  const sides = parts.length === 2 ? [[1, 1], [-1, -1]]
    : Array.from({ length: 8 }, (_, k) => [1, 2, 4].map((bit) => (k & bit ? -1 : 1)));
  const found = [];
  for (const side of sides) {
    const rows = parts.flatMap((part, i) => sweep(part.a, part.b, part.along, part.rays, side[i]));
    for (const turn of balanced && parts.length === 3 ? [1, -1] : [0]) {
      const more = turn === 0 ? [] : [[0, 1], [1, 2], [2, 0]].map(([i, j]) => {
        const s = turn * side[i] * side[j], p = parts[i].a, q = parts[j].a;
        return [[-s * (q[1] - p[1]), s * (q[0] - p[0])], -s * cross(p, q)];
      });
      const polygon = [...rows, ...more].reduce(clip, box);
      if (polygon.length > 2 && area(polygon) > 1e-12 * area(box)) found.push(polygon);
    }
  }
  return found;
}

// --- cones ---

// The part of a cone that is seen from its apex through material: every direction up to where it
// first leaves the object. Directions to vertices cut it into sectors, each of which sees one edge.
function visiblePart(outline, apex, [right, left]) {
  const segments = outline.edges.map(({ start, end }) => [add(start, apex, -1), add(end, apex, -1)]);
  const ahead = add(unit(right), unit(left));
  const turn = (v) => cross(ahead, v) / (ahead[0] * v[0] + ahead[1] * v[1]);
  const corners = segments.map(([v]) => v).filter((v) => cross(right, v) > 0 && cross(v, left) > 0);
  const directions = [right, ...corners.sort((v, w) => turn(v) - turn(w)), left].map(unit);
  const ring = [apex];
  for (let n = 1; n < directions.length; n += 1) {
    const sector = [directions[n - 1], directions[n]];
    const edge = seenEdge(segments, unit(add(...sector)), 1e-9 * outline.size);
    ring.push(...(edge ? sector.map((ray) => add(apex, meetingPoint(edge, ray))) : [apex]));
  }
  return ring;
}

// The first segment that a ray from 0 meets; none if it does not begin in material.
function seenEdge(segments, ray, near) {
  let nearest = Infinity, seen = null, count = 0;
  for (const [p, q] of segments) {
    if (cross(ray, p) * cross(ray, q) >= 0) continue;
    const away = cross(p, q) / cross(ray, add(q, p, -1));
    if (away <= near) continue;
    count += 1;
    if (away < nearest) { nearest = away; seen = [p, q]; }
  }
  return count % 2 ? seen : null;
}

function meetingPoint([p, q], ray) {
  const across = cross(ray, add(q, p, -1));
  return mixed(p, q, across ? Math.max(0, Math.min(1, -cross(ray, p) / across)) : 0);
}

// --- where the object is on the page ---

class View {
  // A picture as wide as there is room, and as high as the object asks for.
  constructor(outline, width, mostHeight) {
    const extent = [outline.high[0] - outline.low[0], outline.high[1] - outline.low[1]];
    const room = [Math.max(width - 2 * PAD, 40), Math.max(mostHeight - 2 * PAD, 40)];
    this.scale = Math.min(room[0] / extent[0], room[1] / extent[1]);
    this.width = width;
    this.height = extent[1] * this.scale + 2 * PAD;
    this.middle = mixed(outline.low, outline.high, 0.5);
    this.outline = outline;
  }

  to(point) {
    return [this.width / 2 + (point[0] - this.middle[0]) * this.scale,
      this.height / 2 - (point[1] - this.middle[1]) * this.scale];
  }

  // The whole picture and a little more, as a polygon in the object's unit.
  get box() {
    const x = (this.width / 2 + 20) / this.scale, y = (this.height / 2 + 20) / this.scale;
    return [[-x, -y], [x, -y], [x, y], [-x, y]].map((corner) => add(this.middle, corner));
  }

  path(points) {
    return `M${points.map((p) => this.to(p).map((v) => v.toFixed(2)).join(",")).join("L")}`;
  }

  // Unit vector away from the material at an edge, on the page.
  outward(edge) {
    const { inward } = this.outline.edges[edge];
    return [-inward[0], inward[1]];
  }

  get edges() {
    this.onPage ??= this.outline.edges.map((edge) => [this.to(edge.start), this.to(edge.end)]);
    return this.onPage;
  }

  // Whether a point of the page is on the material: a ray to the right crosses it oddly often.
  covers([x, y]) {
    let odd = false;
    for (const [a, b] of this.edges) {
      if ((a[1] > y) !== (b[1] > y) && x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])) odd = !odd;
    }
    return odd;
  }
}

// --- where to write ---

// Less than a quarter turn: a finger comes from where there is no material.
const TURNS = [0, 12, -12, 24, -24, 36, -36, 48, -48, 60, -60, 72, -72, 84, -84];
const AWAY = [0, 6, 12, 20, 30, 42, 58, 78, 104, 134];
const EASY = 12;  // what a place costs, at most, near its contact and off all others

// Offsets from contacts to the circles of their fingers: off the object, off each other, on the
// page, near their contacts. Where they are crowded each in its turn is the first one to choose,
// for in a hole there may be room for one alone.
function placeLabels(view, contacts) {
  const fingers = Object.keys(contacts);
  const anchors = Object.fromEntries(fingers.map((k) => [k, view.to(view.outline.at(contacts[k]))]));
  const places = Object.fromEntries(fingers.map((k) => [k, placesFor(view, contacts[k][0], anchors[k])]));
  let least = Infinity, found = {};
  for (let n = 0; n < Math.min(fingers.length, 6) && least > EASY * fingers.length; n += 1) {
    const [cost, placed] = settled([...fingers.slice(n), ...fingers.slice(0, n)], anchors, places);
    if (cost < least) { least = cost; found = placed; }
  }
  return found;
}

// Where a circle may be, each place with what it costs by itself.
function placesFor(view, edge, anchor) {
  const outward = view.outward(edge);
  return AWAY.flatMap((away) => TURNS.map((turn) => {
    const [c, s] = [Math.cos(turn * Math.PI / 180), Math.sin(turn * Math.PI / 180)];
    const direction = [c * outward[0] - s * outward[1], s * outward[0] + c * outward[1]];
    const offset = [0, 1].map((i) => direction[i] * (2 * FINGER + away));
    return { offset, cost: away + 0.12 * Math.abs(turn) + costAlone(view, anchor, offset) };
  }));
}

// Each circle in turn at its cheapest place, then twice more around.
function settled(order, anchors, places) {
  const placed = {}, costs = {};
  for (let round = 0; round < 3; round += 1) {
    for (const k of order) {
      costs[k] = Infinity;
      for (const { offset, cost } of places[k]) {
        if (cost >= costs[k]) continue;
        const all = cost + costAmong(k, offset, anchors, placed);
        if (all < costs[k]) { costs[k] = all; placed[k] = offset; }
      }
    }
  }
  return [order.reduce((sum, k) => sum + costs[k], 0), placed];
}

function costAlone(view, anchor, offset) {
  const center = add(anchor, offset), reach = FINGER + 2;
  let cost = 0;
  for (const [dx, dy] of [[0, 0], [reach, 0], [-reach, 0], [0, reach], [0, -reach]]) {
    const at = [center[0] + dx, center[1] + dy];
    if (view.covers(at)) cost += 50;
    if (at[0] < 0 || at[1] < 0 || at[0] > view.width || at[1] > view.height) cost += 500;
  }
  for (let part = 0.2; part < 0.9; part += 0.2) if (view.covers(add(anchor, offset, part))) cost += 40;
  return cost;
}

function costAmong(k, offset, anchors, placed) {
  const anchor = anchors[k], center = add(anchor, offset);
  let cost = 0;
  for (const other of Object.keys(anchors)) {
    if (other === k) continue;
    if (Math.hypot(center[0] - anchors[other][0], center[1] - anchors[other][1]) < FINGER + 6) cost += 300;
    if (!placed[other]) continue;
    const theirs = add(anchors[other], placed[other]);
    const apart = Math.hypot(center[0] - theirs[0], center[1] - theirs[1]) - 2 * FINGER - 3;
    if (apart < 0) cost += 1000 - 20 * apart;
    if (distance(theirs, anchor, center) < FINGER + 1 || distance(center, anchors[other], theirs) < FINGER + 1) cost += 200;
    if (meet(anchor, center, anchors[other], theirs)) cost += 200;
  }
  return cost;
}

// Of a point from a segment.
function distance(p, a, b) {
  const [ab, ap] = [add(b, a, -1), add(p, a, -1)];
  const part = Math.max(0, Math.min(1, (ap[0] * ab[0] + ap[1] * ab[1]) / (ab[0] ** 2 + ab[1] ** 2)));
  return Math.hypot(...add(ap, ab, -part));
}

function meet(p, q, a, b) {
  const side = (u, v, w) => cross(add(v, u, -1), add(w, u, -1));
  return side(p, q, a) * side(p, q, b) < 0 && side(a, b, p) * side(a, b, q) < 0;
}

// --- the picture ---

const FADE = 40;  // along the border of a picture, in pixels
let fades = 0;

// Draws a scene:
//   contacts    finger -> [edge, fraction]
//   names       finger -> what stands in its circle (by default the finger)
//   offsets     finger -> from its contact to its circle
//   support     the fingers that hold the object
//   rays        finger -> its common cone; friction cones where there is none
//   parallel    whether the common cone is what is drawn
//   regions     finger -> [first, last], where it may be
//   wide        more of these, drawn wider and paler
//   moved, away, released, held    lists of fingers
//   arrows      finger -> [edge, from, to]
//   strong      edges to emphasise
//   cell        whether the set has a focus cell that is to be drawn
//   show        which layers: {cones, regions, focus, edges}
function drawScene(svg, view, scene) {
  const { outline } = view, show = scene.show;
  const ring = `${outline.rings.map((points) => view.path(points)).join("Z")}Z`;
  const layer = [draw("path", { class: "material", d: ring })];
  if (show.cones && !(scene.support.length === 2 && scene.parallel)) {
    layer.push(...scene.support.map((k) => coneOf(view, scene, k)));
  }
  if (show.focus) layer.push(...focusOf(view, scene));
  layer.push(draw("path", { class: "outline", d: ring }));
  for (const edge of scene.strong ?? []) {
    const { start, end } = outline.edges[edge];
    layer.push(draw("path", { class: "edge", d: view.path([start, end]) }));
  }
  if (show.regions) {
    layer.push(...bands(view, scene, scene.wide, "band all"), ...bands(view, scene, scene.regions, "band"));
  }
  if (scene.support.length === 2) {
    layer.push(draw("path", { class: "force", d: view.path(scene.support.map((k) => outline.at(scene.contacts[k]))) }));
  }
  const offsets = scene.offsets ?? placeLabels(view, scene.contacts);
  if (show.edges || scene.strong) layer.push(...edgeNumbers(view, scene, offsets));
  for (const [k, [edge, from, to]] of Object.entries(scene.arrows ?? {})) layer.push(...arrow(view, edge, from, to, k));
  for (const k of Object.keys(scene.contacts)) layer.push(finger(view, scene, k, offsets[k]));
  svg.setAttribute("viewBox", `0 0 ${view.width} ${view.height.toFixed(1)}`);
  svg.replaceChildren(...layer);
}

function coneOf(view, scene, k) {
  const [edge] = scene.contacts[k], apex = view.outline.at(scene.contacts[k]);
  const common = scene.parallel && scene.rays[k];
  return draw("path", { class: common ? "cone common" : "cone", d: `${view.path(visiblePart(view.outline, apex, common || view.outline.rays(edge)))}Z` });
}

function focusOf(view, scene) {
  if (scene.parallel || scene.support.length < 2 || scene.support.length > 3) return [];
  const parts = focusParts(view.outline, scene);
  const points = focusRegions(parts.map((p) => ({ ...p, a: p.at, b: p.at })), view.box, true);
  const cell = scene.cell ? focusRegions(parts, view.box) : [];
  const shape = (polygons, name) => draw("path", { class: name, d: polygons.map((p) => `${view.path(p)}Z`).join("") });
  const fade = `fade-${fades += 1}`;
  return [...fadeMask(view, fade), draw("g", { mask: `url(#${fade})` }, shape(cell, "cell"), shape(points, "focus"))];
}

// What goes on beyond the picture fades towards its border.
function fadeMask({ width, height }, id) {
  const stop = (offset, opacity) => draw("stop", { offset, "stop-color": "#fff", "stop-opacity": opacity });
  const ramp = (name, length, x2, y2) => draw("linearGradient", { id: `${id}-${name}`, x1: 0, y1: 0, x2, y2 },
    stop(0, 0), stop(FADE / length, 1), stop(1 - FADE / length, 1), stop(1, 0));
  const mask = (name, attributes) => draw("mask", { id: name, maskUnits: "userSpaceOnUse", x: 0, y: 0, width, height },
    draw("rect", { width, height, ...attributes }));
  return [ramp("x", width, 1, 0), ramp("y", height, 0, 1), mask(`${id}-rows`, { fill: `url(#${id}-y)` }),
    mask(id, { fill: `url(#${id}-x)`, mask: `url(#${id}-rows)` })];
}

// The supporting contacts, whole edges and cones, as `focusRegions` takes them.
function focusParts(outline, scene) {
  return scene.support.map((k) => {
    const [edge] = scene.contacts[k], { start, end, along } = outline.edges[edge];
    return { a: start, b: end, at: outline.at(scene.contacts[k]), along, rays: scene.rays[k] ?? outline.rays(edge) };
  });
}

function bands(view, scene, regions, name) {
  return Object.entries(regions ?? {}).map(([k, ends]) => {
    const [edge] = scene.contacts[k];
    return draw("path", { class: name, d: view.path(ends.map((f) => view.outline.at([edge, f]))) });
  });
}

// Beside its edge, so that the contact stays to be seen.
function arrow(view, edge, from, to) {
  if (from === to) return [];
  const outward = view.outward(edge), lift = [outward[0] * 6, outward[1] * 6];
  let [a, b] = [from, to].map((f) => add(view.to(view.outline.at([edge, f])), lift));
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
  const { along } = view.outline.edges[edge], sign = Math.sign(to - from);
  const ahead = [along[0] * sign, -along[1] * sign];
  if (length < 16) a = add(b, ahead, -16);
  const side = [-ahead[1], ahead[0]], neck = add(b, ahead, -8);
  const head = [b, add(neck, side, 4), add(neck, side, -4)].map((p) => p.map((v) => v.toFixed(2)).join(",")).join("L");
  return [draw("line", { class: "arrow", x1: a[0], y1: a[1], x2: neck[0], y2: neck[1] }),
    draw("path", { class: "arrow-head", d: `M${head}Z` })];
}

function finger(view, scene, k, offset) {
  const at = view.to(view.outline.at(scene.contacts[k])), to = add(at, offset);
  const is = (list) => (scene[list] ?? []).map(String).includes(String(k));
  const names = ["held", "moved", "away", "released"].filter(is);
  if (!is("support") && !is("moved") && !is("released")) names.push("touches");
  return draw("g", { class: names.join(" "), "data-finger": k },
    draw("line", { class: "leader", x1: at[0], y1: at[1], x2: to[0], y2: to[1] }),
    draw("circle", { class: "contact", cx: at[0], cy: at[1], r: 3.4 }),
    draw("circle", { class: "finger", cx: to[0], cy: to[1], r: FINGER }),
    draw("text", { class: "number", x: to[0], y: to[1] + 4.3 }, scene.names?.[k] ?? k));
}

// Numbers of edges beside them, the emphasised ones first and then the longest, where there is room.
function edgeNumbers(view, scene, offsets) {
  const strong = scene.strong ?? [];
  const taken = Object.keys(scene.contacts).map((k) => {
    const at = view.to(view.outline.at(scene.contacts[k]));
    return [...add(at, offsets[k]), FINGER + 2];
  });
  const rank = (i) => (strong.includes(i) ? 1e9 : 0) + view.outline.edges[i].length;
  const order = view.edges.map((_, i) => i).filter((i) => scene.show.edges || strong.includes(i));
  order.sort((i, j) => rank(j) - rank(i));
  const found = [];
  for (const i of order) {
    const [a, b] = view.edges[i], outward = view.outward(i), isStrong = strong.includes(i);
    const radius = String(i).length * 3 + 4;
    const places = [0.5, 0.35, 0.65, 0.2, 0.8].flatMap((f) => [11, 20, 30, ...(isStrong ? [-12, 42] : [])].map((away) => add(mixed(a, b, f), outward, away)));
    const clear = ([px, py]) => px > radius && py > radius && px < view.width - radius && py < view.height - radius
      && taken.every(([x, y, r]) => Math.hypot(px - x, py - y) > r + radius);
    const place = places.find((p) => !view.covers(p) && clear(p)) ?? (isStrong ? places.find(clear) ?? places[0] : null);
    if (!place) continue;
    taken.push([...place, radius]);
    found.push(draw("text", { class: isStrong ? "edge-number strong" : "edge-number", x: place[0], y: place[1] + 4 }, String(i)));
  }
  return found;
}

// --- controls that pages share ---

// Boxes to tick for the layers of the picture, with signs, some with a second one; `signs` are
// those without a box.
function layerBoxes(layers, signs, show, changed) {
  const signed = ([sign, words]) => [...(sign ? [make("span", { class: `sign ${sign}` })] : []), words];
  const boxes = layers.map(([name, ...those]) => {
    const box = make("input", { type: "checkbox", id: `show-${name}` });
    box.checked = show[name];
    box.addEventListener("change", () => { show[name] = box.checked; changed(); });
    return make("label", {}, box, ...signed(those), ...signed(those.slice(2)).filter(Boolean));
  });
  const keys = signs.map((one) => make("span", {}, ...signed(one)));
  byId("layers").replaceChildren(...boxes, make("span", { class: "keys" }, ...keys));
}

// Windows in which a page is seen as a whole, and only its lists scroll; elsewhere the page does.
const roomy = matchMedia("(min-width: 52.01rem) and (min-height: 40rem)");
const seenWhole = () => roomy.matches && !byId("text").open;

// The height that is left for an element if what follows in its section, up to `last`, is to be
// seen without scrolling.
function roomFor(element, last) {
  const at = (one) => one.getBoundingClientRect();
  const top = at(element).top + (seenWhole() ? 0 : scrollY), below = at(last).bottom - at(element).bottom;
  return (seenWhole() ? at(element.closest("section")).bottom : innerHeight - 8) - top - below;
}

// Calls when the window has another width, or another height that matters: not when the bars of
// a phone's browser come and go.
function onResize(call) {
  let [width, height] = [innerWidth, innerHeight];
  addEventListener("resize", () => {
    if (innerWidth === width && (innerHeight === height || !roomy.matches)) return;
    [width, height] = [innerWidth, innerHeight];
    call();
  });
  roomy.addEventListener("change", call);
}

// For print: what is folded away on the screen is on paper.
let unfolded = [];
addEventListener("beforeprint", () => {
  unfolded = [...document.querySelectorAll("details:not([open])")];
  for (const one of unfolded) one.open = true;
});
addEventListener("afterprint", () => { for (const one of unfolded) one.open = false; });
