// The page of a plan: time runs from 0, the start, to the number of steps; in between everything
// is linear, as it is in the plan.

const outline = new Outline(DATA.object);
const { moments, transitions } = DATA;
const END = transitions.length;
const show = { cones: true, regions: true, focus: true, edges: false };
const calm = matchMedia("(prefers-reduced-motion: reduce)");
let time = 0, playing = false, goal = null;

// --- what there is at an instant ---

function sceneAt(t) {
  const i = Math.min(Math.floor(t), END), s = t - i;
  return s === 0 || i === END ? atRest(i) : onTheWay(i, s);
}

function atRest(i) {
  const moment = moments[i], last = transitions[i - 1];
  const scene = { ...momentScene(moment), moved: [], released: [], arrows: {}, show };
  if (last?.action === "release") {
    const [k] = last.fingers;
    scene.contacts = { ...scene.contacts, [k]: moments[i - 1].contacts[k] };
    scene.released = [k];
  } else if (last) {
    scene.moved = last.fingers;
    if (last.action === "slide") {
      for (const k of last.fingers) scene.arrows[k] = [moment.contacts[k][0], moments[i - 1].contacts[k][1], moment.contacts[k][1]];
    }
  }
  return scene;
}

function momentScene(moment) {
  return { contacts: moment.contacts, support: moment.support, rays: moment.rays, parallel: moment.parallel,
    regions: moment.regions, cell: moment.kind === "concurrent" || moment.kind === "two-finger" };
}

function onTheWay(i, s) {
  const { action, fingers, regions } = transitions[i], [before, after] = [moments[i], moments[i + 1]];
  const base = action === "release" ? after : before;
  const scene = { ...momentScene(base), moved: fingers, released: [], away: [], arrows: {}, show };
  if (action === "slide") {
    scene.contacts = slid(before.contacts, after.contacts, s);
    scene.regions = Object.fromEntries(Object.entries(regions ?? {}).map(([k, [a, b]]) => [k, mixed(a, b, s)]));
    return scene;
  }
  // A finger on its way to or from the object does not touch it.
  const [k] = fingers;
  scene.contacts = { ...base.contacts, [k]: (action === "place" ? after : before).contacts[k] };
  scene.away = [k];
  scene.lift = { [k]: action === "place" ? 1 - s : s };
  return scene;
}

function slid(before, after, s) {
  return Object.fromEntries(Object.entries(before).map(([k, [edge, f]]) => [k, [edge, mix(f, after[k][1], s)]]));
}

// The margin of the supporting fingers: min(max v, -min v) of their torque functions.
function marginAt(t) {
  const i = Math.min(Math.floor(t), END), s = t - i;
  if (s === 0) return moments[i].margin;
  if (transitions[i].action !== "slide") return moments[transitions[i].action === "release" ? i + 1 : i].margin;
  const { values } = transitions[i];
  return values && least(values[0].map((v, n) => mix(v, values[1][n], s)));
}

const least = (values) => Math.min(Math.max(...values), -Math.min(...values));

// The tolerance: the same functions by their rates, ends of edges, and the limits of the hand.
function toleranceAt(t) {
  const i = Math.min(Math.floor(t), END), s = t - i;
  if (s === 0) return moments[i].tolerance;
  if (transitions[i].action !== "slide") return moments[transitions[i].action === "release" ? i + 1 : i].tolerance;
  const { values, rates } = transitions[i], before = moments[i];
  if (!values) return null;
  const contacts = slid(before.contacts, moments[i + 1].contacts, s);
  const rooms = [least(values[0].map((v, n) => mix(v, values[1][n], s) / rates[n]))];
  for (const k of before.support) {
    const [edge, f] = contacts[k];
    rooms.push(Math.min(f, 1 - f) * outline.edges[edge].length);
  }
  for (const [k, [low, high]] of Object.entries(before.reach)) {
    const [edge, f] = contacts[k];
    rooms.push(Math.min(f - low, high - f) * outline.edges[edge].length);
  }
  const points = Object.values(contacts).map((contact) => outline.at(contact));
  points.forEach((p, n) => points.slice(0, n).forEach((q) => {
    const apart = Math.hypot(p[0] - q[0], p[1] - q[1]);
    if (DATA.span !== null) rooms.push((DATA.span - apart) / 2);
    if (DATA.separation > 0) rooms.push((apart - DATA.separation) / 2);
  }));
  return Math.min(...rooms);
}

// --- the picture ---

let view = null, labels = [];

function resized() {
  const svg = byId("picture"), width = svg.clientWidth || svg.parentElement.clientWidth;
  CHART.height = innerHeight < 700 ? 90 : 120;
  drawChart();
  reserveWords();
  const room = roomFor(svg, seenWhole() ? byId("layers") : byId("curves"));
  view = new View(outline, width, Math.max(seenWhole() ? 150 : 220, Math.min(room, width)));
  svg.setAttribute("height", view.height);
  labels = [];
  update();
}

// As much room as the longest words take, so that nothing below them jumps.
function reserveWords() {
  const now = byId("now");
  now.setAttribute("aria-live", "off");
  now.style.minHeight = "";
  const heights = moments.flatMap((_, i) => [i, Math.min(i + 0.5, END)]).map((t) => (sayInstant(t), now.offsetHeight));
  now.style.minHeight = `${Math.max(...heights)}px`;
}

// Circles have their places at moments; in between they go from one place to the next.
function offsetsAt(t, at = view, places = labels) {
  const i = Math.min(Math.floor(t), END), s = t - i;
  const place = (n) => (places[n] ??= placeLabels(at, atRest(n).contacts));
  if (s === 0) return place(i);
  const [before, after] = [place(i), place(i + 1)], { lift } = onTheWay(i, s);
  const keys = new Set([...Object.keys(before), ...Object.keys(after)]);
  return Object.fromEntries([...keys].map((k) => {
    const offset = mixed(before[k] ?? after[k], after[k] ?? before[k], s);
    return [k, add([0, 0], offset, 1 + 0.55 * (lift?.[k] ?? 0))];
  }));
}

function update() {
  const scene = sceneAt(time);
  drawScene(byId("picture"), view, { ...scene, offsets: offsetsAt(time) });
  byId("time").value = time;
  byId("time").setAttribute("aria-valuetext", `step ${text(time, 3)} of ${END}`);
  mark();
  const current = Number.isInteger(time) ? time : Math.ceil(time);
  if (byId("steps").dataset.current !== String(current)) {
    byId("steps").dataset.current = current;
    byId("steps").querySelectorAll("button").forEach((button, n) => {
      button.toggleAttribute("aria-current", n === current);
      if (n === current) {
        button.setAttribute("aria-current", "step");
        intoView(button);
      }
    });
  }
  // what changes with every frame is not read out
  byId("now").setAttribute("aria-live", Number.isInteger(time) ? "polite" : "off");
  sayInstant(time);
}

function sayInstant(t) {
  const words = describeInstant(t);
  if (byId("now").textContent !== words.join("")) byId("now").replaceChildren(make("b", {}, words[0]), make("br"), make("small", {}, words[1]));
}

// Only within the list, never the page under somebody's eyes.
function intoView(button) {
  const list = byId("account"), top = button.parentElement.offsetTop - list.offsetTop;
  if (top < list.scrollTop || top + button.offsetHeight > list.scrollTop + list.clientHeight) {
    list.scrollTop = top - list.clientHeight / 3;
  }
}

function describeInstant(t) {
  const i = Math.floor(t);
  if (t === i) {
    const moment = moments[i];
    return [`${i}. ${stepText(i)}${i === END ? " – goal" : ""}`, `held by ${moment.support.join(", ")} (${moment.kind}), margin ${text(moment.margin)}, tolerance ${text(moment.tolerance)}`];
  }
  const base = moments[transitions[i].action === "release" ? i + 1 : i];
  return [`${i + 1}. ${stepText(i + 1)} …`, `held by ${base.support.join(", ")} (${base.kind}), now margin ${text(marginAt(t))}, tolerance ${text(toleranceAt(t))}`];
}

const stepText = (i) => (i ? transitions[i - 1].text
  : `start: ${Object.entries(moments[0].contacts).map(([k, [edge, f]]) => `${k} on edge ${edge} at ${text(f * outline.edges[edge].length)}`).join(", ")}`);

// --- the chart: margin and tolerance over time ---

const CHART = { height: 120, left: 44, right: 10, top: 8, bottom: 20 };
let chartX = () => 0, chartWidth = 0;

// All instants at which a curve may bend: ends, and where two functions or their negatives cross.
function bends(i) {
  const { action, values } = transitions[i];
  if (action !== "slide" || !values) return [0, 1];
  const lines = values[0].flatMap((v, n) => [[v, values[1][n]], [-v, -values[1][n]]]);
  const found = new Set([0, 1]);
  lines.forEach(([a, b], n) => lines.slice(0, n).forEach(([c, d]) => {
    const s = (c - a) / ((b - a) - (d - c));
    if (s > 0 && s < 1) found.add(s);
  }));
  return [...found].sort((p, q) => p - q);
}

// Tolerances bend at other instants, too, and along curves: there they are taken close together.
function curve(of, dense) {
  const points = [[0, of(0)]];
  for (let i = 0; i < END; i += 1) {
    const instants = new Set(bends(i));
    if (dense && transitions[i].action === "slide") for (let n = 1; n < 40; n += 1) instants.add(n / 40);
    const inner = [...instants].sort((p, q) => p - q);
    // placing and releasing change what is held at once
    if (transitions[i].action === "place") inner.splice(1, 0, 1 - 1e-9);
    if (transitions[i].action === "release") inner.splice(1, 0, 1e-9);
    for (const s of inner) points.push([i + s, of(s === 1 ? i + 1 : i + s)]);
  }
  return points;
}

function drawChart() {
  const svg = byId("chart"), width = svg.clientWidth || svg.parentElement.clientWidth;
  const curves = { margin: curve(marginAt, false), tolerance: curve(toleranceAt, true) };
  const every = Object.values(curves).flat().map(([, v]) => v).filter((v) => v !== null && Number.isFinite(v));
  const top = Math.max(...every, 1e-300), bottom = Math.min(0, ...every);
  const { height, left, right, top: above, bottom: below } = CHART;
  chartWidth = width;
  chartX = (t) => left + (width - left - right) * (END ? t / END : 0.5);
  const y = (v) => above + (height - above - below) * (1 - (v - bottom) / (top - bottom));
  const parts = [];
  for (const tick of ticks(bottom, top)) {
    parts.push(draw("line", { x1: left, x2: width - right, y1: y(tick), y2: y(tick), stroke: "var(--line)", "stroke-width": tick === 0 ? 1.5 : 0.7 }),
      draw("text", { x: left - 5, y: y(tick) + 4, "text-anchor": "end" }, text(tick, 3)));
  }
  const every_n = Math.max(1, Math.ceil(END * 26 / (width - left - right)));
  for (let i = 0; i <= END; i += every_n) parts.push(draw("text", { x: chartX(i), y: height - 5, "text-anchor": "middle" }, String(i)));
  const line = (points) => `M${points.filter(([, v]) => v !== null && Number.isFinite(v)).map(([t, v]) => `${chartX(t).toFixed(2)},${y(v).toFixed(2)}`).join("L")}`;
  parts.push(draw("path", { d: line(curves.tolerance), fill: "none", stroke: "var(--vermillion)", "stroke-width": 1.8, "stroke-dasharray": "5 3" }),
    draw("path", { d: line(curves.margin), fill: "none", stroke: "var(--accent)", "stroke-width": 2.4 }));
  moments.forEach((moment, i) => {
    if (moment.margin !== null) parts.push(draw("circle", { cx: chartX(i), cy: y(moment.margin), r: 3.2, fill: "var(--accent)" }));
    if (moment.tolerance !== null) {
      const [cx, cy] = [chartX(i), y(moment.tolerance)];
      parts.push(draw("path", { d: `M${cx},${cy - 4}l4,4l-4,4l-4,-4z`, fill: "var(--vermillion)" }));
    }
  });
  parts.push(draw("line", { id: "mark", y1: above - 4, y2: height - below + 4, stroke: "var(--ink)", "stroke-width": 2, "stroke-opacity": 0.55 }));
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("height", height);
  svg.setAttribute("aria-label", `Margin and tolerance over ${counted(END, "step")}: least margin ${text(DATA.margin)}, least tolerance ${text(DATA.tolerance)}`);
  svg.replaceChildren(...parts);
}

// Round numbers from bottom to top, three or four.
function ticks(bottom, top) {
  const rough = (top - bottom) / 3, power = 10 ** Math.floor(Math.log10(rough));
  const unit = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
  const found = [];
  for (let n = Math.ceil(bottom / unit); n * unit <= top * (1 + 1e-9); n += 1) found.push(n * unit);
  return found;
}

function mark() {
  const line = byId("mark");
  line.setAttribute("x1", chartX(time));
  line.setAttribute("x2", chartX(time));
}

// --- going through it ---

const PACE = 1100, REST = 450;  // milliseconds for a step, and at each moment
let before = null, rest = 0;

function go(t) {
  goal = null;
  pause();
  time = Math.max(0, Math.min(END, t));
  update();
}

// Steps are seen happening, unless somebody wants no motion or is in a hurry.
function stepTo(t) {
  const to = Math.max(0, Math.min(END, t));
  if (calm.matches || goal !== null || Math.abs(to - time) > 1) return go(to);
  pause();
  goal = to;
  start();
}

function play() {
  if (playing) return pause();
  if (time === END) time = 0;
  goal = null;
  playing = true;
  rest = 0;
  document.body.classList.add("playing");
  byId("play").setAttribute("aria-label", "Pause");
  start();
}

function pause() {
  playing = false;
  document.body.classList.remove("playing");
  byId("play").setAttribute("aria-label", "Play");
}

function start() {
  before = null;
  requestAnimationFrame(frame);
}

function frame(now) {
  if (!playing && goal === null) return;
  const passed = before === null ? 0 : (now - before) * Number(byId("speed").value);
  before = now;
  if (goal !== null) {
    const left = goal - time, way = passed / PACE;
    time = Math.abs(left) <= way ? goal : time + Math.sign(left) * way;
    if (time === goal) goal = null;
  } else {
    advance(passed);
  }
  update();
  if (playing || goal !== null) requestAnimationFrame(frame);
}

function advance(passed) {
  if (rest > 0) {
    rest -= passed;
    return;
  }
  const next = Math.floor(time) + 1;
  time = calm.matches ? next : Math.min(time + passed / PACE, next);
  if (time === next) rest = calm.matches ? PACE + REST : REST;
  if (time >= END) {
    time = END;
    pause();
  }
}

const nextStep = () => stepTo(Math.floor(time) + 1);
const previousStep = () => stepTo(Math.ceil(time) - 1);

const KEYS = { ArrowRight: nextStep, ArrowDown: nextStep, ArrowLeft: previousStep, ArrowUp: previousStep,
  Home: () => go(0), End: () => go(END), " ": play };

function keyed(event) {
  const to = event.target, typing = to.matches?.("select, summary, input[type=checkbox]");
  if (event.altKey || event.ctrlKey || event.metaKey || typing || !KEYS[event.key]) return;
  if (event.key === " " && to.matches?.("button")) return;  // it presses the button
  event.preventDefault();
  KEYS[event.key]();
}

// --- the page ---

function stepList() {
  byId("steps").replaceChildren(...moments.map((moment, i) => {
    const way = i && transitions[i - 1].action === "slide" ? transitions[i - 1].margin : null;
    const onTheWayText = way !== null && way < moment.margin ? `, on the way ${text(way)}` : "";
    const button = make("button", { type: "button" }, make("b", {}, String(i)), make("span", {}, stepText(i)),
      make("small", {}, `held by ${moment.support.join(", ")} · margin ${text(moment.margin)}${onTheWayText} · tolerance ${text(moment.tolerance)}`));
    button.addEventListener("click", () => (i === Math.ceil(time) + 1 ? stepTo(i) : go(i)));
    return make("li", {}, button);
  }));
  byId("remarks").replaceChildren(...[...DATA.head, ...DATA.end.split(/\n(?! )/)].map((line) => make("p", {}, line.replace(/\s+/g, " "))));
}

function signs() {
  const all = moments.concat();
  const has = (test) => all.some(test);
  const layers = [];
  layers.push(["cones", has((m) => m.parallel) && !has((m) => !m.parallel) ? "common" : "cone", "friction cones"]);
  layers.push(["regions", "region", "where it may be"]);
  const cells = has((m) => m.kind === "concurrent" || m.kind === "two-finger") ? ["cell", "focus cell"] : [];
  if (has((m) => !m.parallel)) layers.push(["focus", "focus", "focus points", ...cells]);
  layers.push(["edges", null, "edge numbers"]);
  const keys = [["dot supports", "supports the object"]];
  if (has((m, i) => Object.keys(m.contacts).some((k) => !m.support.includes(Number(k))))) keys.push(["dot touches", "only touches"]);
  if (transitions.some((t) => t.action !== "release")) keys.push(["dot moved", "moves, or has moved"]);
  if (transitions.some((t) => t.action === "release")) keys.push(["dot released", "just released"]);
  if (has((m) => m.support.length === 2)) keys.push(["force", "two-finger grasp"]);
  if (has((m) => m.parallel) && has((m) => !m.parallel)) keys.push(["common", "common cone"]);
  layerBoxes(layers, keys, show, update);
}

// For print: all moments, each with its words.
function filmstrip() {
  const frames = moments.map((moment, i) => {
    const at = new View(outline, 250, 230), svg = draw("svg", { width: at.width, height: at.height });
    drawScene(svg, at, atRest(i));
    return make("figure", {}, svg, make("figcaption", {}, make("b", {}, `${i} `), stepText(i), make("br"),
      `held by ${moment.support.join(", ")}: margin ${text(moment.margin)}, tolerance ${text(moment.tolerance)}`));
  });
  byId("filmstrip").replaceChildren(...frames);
}

byId("facts").textContent = [counted(END, "step"), counted(DATA.placements, "placement"), counted(DATA.fingers, "finger"),
  `least margin ${text(DATA.margin)}`, `least tolerance ${text(DATA.tolerance)}`,
  ...(DATA.chosen ? [`without start and goal, which are given: ${text(DATA.chosen.margin)} and ${text(DATA.chosen.tolerance)}`] : [])].join(" · ");
byId("time").max = END;
byId("time").addEventListener("input", () => {
  // near a moment the moment itself is meant
  const t = Number(byId("time").value), near = Math.round(t);
  go(Math.abs(t - near) < 0.04 ? near : t);
});
byId("first").addEventListener("click", () => go(0));
byId("last").addEventListener("click", () => go(END));
byId("next").addEventListener("click", nextStep);
byId("previous").addEventListener("click", previousStep);
byId("play").addEventListener("click", play);
byId("chart").addEventListener("click", (event) => {
  const box = byId("chart").getBoundingClientRect();
  const x = (event.clientX - box.left) * chartWidth / box.width;
  const [from, to] = [chartX(0), chartX(END)];
  go(END ? Math.round(END * Math.max(0, Math.min(1, (x - from) / (to - from)))) : 0);
});
document.addEventListener("keydown", keyed);
stepList();
signs();
resized();
filmstrip();
addEventListener("beforeprint", filmstrip);
onResize(resized);

// For whoever looks under the hood, and for tests.
globalThis.regrasp = { go, play, sceneAt, marginAt, toleranceAt, outline, focusRegions, focusParts, visiblePart,
  get time() { return time; }, get playing() { return playing; }, get view() { return view; } };
