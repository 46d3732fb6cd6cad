// A study on the screen: a person moves the patient, and the DRRs follow; the same registration as everywhere begins there.
import {bytes, element, kBeingRead, get, make, post, setStudy, signedIn, verdictCell} from "/shared.js";
import {ManualView} from "/manual_view.js";
import {anglesDeg, fromNumbers, motionOf, moved, planned, turned} from "/pose.js";

// Of the room's screen, "/session/NAME/by-hand"; else isoshift view serves one study.
const [, folder, session] = location.pathname.split("/");
const isOfRoom = folder === "session";
const kApi = isOfRoom ? "/api/sessions/" + session + "/manual/" : "/api/manual/";
const kMoving = 1, kAtRest = 0;    // detail of the DRRs: half the pixels along an edge, or all
const kRestMs = 150, kFlickerMs = 500, kAskMs = 300, kReadMs = 1000;
const kModes = ["blend", "side", "wipe", "flicker", "difference"];
const kNumbers = ["x", "y", "z", "rx", "ry", "rz"];
const kAxes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

let pose = planned, restingPose = planned;
const history = [];
let user = "";
let wanted = null, isAsking = false, resting = null;
let isFlickered = false;
const views = [];
let shownPose = null;   // of the DRRs on the screen
let handOverFolder = "";  // of the result that is on the screen
let tool = "move";      // what the mouse does: "move", "box" or "mark"
const landmarks = [];   // {xrays, drrs}: pixels by view, or null

// What is drawn.

const mode = () => document.querySelector("input[name=mode]:checked").value;
const grays = name => ({brightness: +element(name + "-brightness").value, contrast: +element(name + "-contrast").value});

function draw() {
  const begin = performance.now();
  const marks = Object.fromEntries(["field", "cross", "letters"].map(id => [id, element(id).checked]));
  const look = {mode: mode(), wipe: element("wipe").value / 100, isFlickered, xray: grays("xray"), drr: grays("drr"), marks};
  for (const view of views) view.draw(look);
  return performance.now() - begin;
}

function layOut() {
  const isDouble = mode() === "side", place = element("views");
  const caption = 30, width = place.clientWidth, height = place.clientHeight - 10;
  const edge = isDouble ? Math.min(width / 2 - 15, height / views.length - caption)
    : Math.min(width / views.length - 15, height - caption);
  for (const view of views) view.resize(Math.max(200, Math.floor(edge)), isDouble);
  draw();
}

// The DRRs follow: the newest pose is asked for once the one before has arrived.

async function follow() {
  if (isAsking || !wanted) return;
  isAsking = true;
  const asked = wanted;
  wanted = null;
  try {
    const begin = performance.now();
    const {data, headers} = await bytes(kApi + "drrs", {setup_error: asked.pose, detail: asked.detail});
    let at = 0;
    for (const view of views) {
      const [columns, rows] = view.sizes[asked.detail];
      view.drr = data.subarray(at, at += columns * rows);
      view.detail = asked.detail;
    }
    shownPose = asked.pose;
    const painted = draw();
    element("times").textContent = "DRRs of " + views.map(view => view.sizes[asked.detail].join(" x ")).join(", ") + ": rendered in " +
      headers.get("X-Isoshift-Milliseconds") + " ms, painted in " + painted.toFixed(0) + " ms, " +
      (performance.now() - begin).toFixed(0) + " ms in all";
    element("times").dataset.pose = JSON.stringify(asked.pose);  // of what is on the screen
    if (asked.detail === kAtRest) {
      problem("");
      await showOutline(asked.pose);
    }
  } catch (error) {
    problem(error.message);
  }
  isAsking = false;
  follow();
}

function ask(detail) {
  wanted = {pose, detail};
  follow();
}

const numbers = () => kNumbers.map(id => element(id).valueAsNumber);

function showNumbers() {
  const six = [...pose.translation_mm, ...anglesDeg(pose)];
  kNumbers.forEach((id, n) => {
    if (document.activeElement !== element(id)) element(id).value = (Math.round(six[n] * 100) / 100 || 0).toFixed(2);
  });
}

// The outlines of the chosen part at a pose.
async function showOutline(at) {
  const part = element("part").value;
  const {views: outlines} = part === "" ? {views: []} : await post(kApi + "outlines", {setup_error: at, part: +part});
  if (at !== pose) return;  // moved on since
  views.forEach((view, n) => { view.outline = outlines[n] || []; });
  draw();
}

// The patient is moved; `rest` comes when that has ended. What belongs to the pose before is taken off.
function set(next) {
  pose = next;
  for (const view of views) view.outline = [];
  forgetMarksInDrrs();
  showNumbers();
  ask(kMoving);
  clearTimeout(resting);
  resting = setTimeout(rest, kRestMs);
}

function rest() {
  clearTimeout(resting);
  if (pose !== restingPose) {
    history.push(restingPose);
    restingPose = pose;
    element("undo").disabled = false;
  }
  ask(kAtRest);
}

function undo() {
  if (history.length === 0) return;
  pose = restingPose = history.pop();
  forgetMarksInDrrs();
  element("undo").disabled = history.length === 0;
  showNumbers();
  ask(kAtRest);
}

// Keys and mouse.

const step = () => +element("step").value;
const on = {
  tool: () => tool,
  mark,
  boxed: () => {
    element("no-boxes").disabled = views.every(view => !view.box);
    draw();
  },
  drag: (view, pixels) => set(moved(pose, motionOf(view.px_per_mm, pixels))),
  turn: (view, deg) => set(turned(pose, view.from_source, deg)),
  wheel: (view, sign) => set(turned(pose, view.from_source, sign * step())),
  look: draw,
  rest
};

const scaled = (axis, by) => axis.map(value => value * by);

// Right and down on the view, and away from its source: directions in the room of length 1.
function directionsOf(view) {
  const unit = mm => scaled(mm, 1 / Math.hypot(...mm));
  return [unit(motionOf(view.px_per_mm, [1, 0])), unit(motionOf(view.px_per_mm, [0, 1])), view.from_source];
}

function moveByKey(key, isTurn) {
  const view = views.find(one => one.hasFocus), by = step();
  const sign = {ArrowLeft: -1, ArrowRight: 1, ArrowUp: -1, ArrowDown: 1, PageUp: 1, PageDown: -1}[key];
  const which = {ArrowLeft: 0, ArrowRight: 0, ArrowUp: 1, ArrowDown: 1, PageUp: 2, PageDown: 2}[key];
  if (sign === undefined) return false;
  if (view && isTurn) set(turned(pose, view.from_source, sign * by));
  else if (view) set(moved(pose, scaled(directionsOf(view)[which], sign * by)));
  else if (isTurn) set(turned(pose, [kAxes[2], kAxes[0], kAxes[1]][which], sign * by));
  else set(moved(pose, [scaled(kAxes[0], sign * by), scaled(kAxes[2], -sign * by), scaled(kAxes[1], sign * by)][which]));
  return true;
}

document.addEventListener("keydown", event => {
  const isText = ["INPUT", "SELECT"].includes(event.target.tagName) && !["checkbox", "button"].includes(event.target.type);
  if (isText || event.ctrlKey || event.metaKey || event.altKey) return;
  const number = kModes[+event.key - 1];
  if (moveByKey(event.key, event.shiftKey)) event.preventDefault();
  else if (number) document.querySelector(`input[value=${number}]`).click();
  else if (event.key === "s") element("step").selectedIndex = 1 - element("step").selectedIndex;
  else if (event.key === "u") undo();
  else if (event.key === "+" || event.key === "-") zoom(event.key === "+");
});

function zoom(isLarger) {
  for (const view of views) view.zoomBy(isLarger ? 1.2 : 1 / 1.2);
}

// Tools for the mouse.

function use(next) {
  tool = tool === next ? "move" : next;
  for (const name of ["box", "mark"]) element(name).setAttribute("aria-pressed", tool === name);
  document.body.classList.toggle("points", tool !== "move");
  if (tool === "mark" && mode() !== "side") document.querySelector("input[value=side]").click();
}

// Landmarks: a click in the X-ray and in the DRR of two views or more. The next one begins when the same views have both.

const isWhole = landmark => landmark.xrays.filter(mark => mark).length >= 2 &&
  landmark.xrays.every((mark, n) => !mark === !landmark.drrs[n]);

function mark(view, isDrr, pixel) {
  if (isDrr && shownPose !== pose) return;  // what was clicked is about to change
  let current = landmarks.find(one => !isWhole(one));
  if (!current) landmarks.push(current = {xrays: views.map(() => null), drrs: views.map(() => null)});
  current[isDrr ? "drrs" : "xrays"][views.indexOf(view)] = pixel;
  showLandmarks();
}

function showLandmarks() {
  views.forEach((view, n) => {
    view.marks = ["xrays", "drrs"].map(kind =>
      landmarks.flatMap((one, number) => one[kind][n] ? [{pixel: one[kind][n], number: number + 1}] : []));
  });
  const open = landmarks.findIndex(one => !isWhole(one)), one = landmarks[open];
  const missing = one ? views.flatMap((view, v) =>
    [["xrays", "X-ray"], ["drrs", "DRR"]].filter(([kind]) => !one[kind][v]).map(([, name]) => `${name} of ${view.label}`)) : [];
  const enough = views.length > 2 ? " (two views are enough)" : "";
  element("landmarks").textContent = landmarks.length === 0 ? ""
    : one ? `Mark landmark ${open + 1} in: ${missing.join(", ")}${enough}` : landmarks.length + " marked";
  element("fit").disabled = landmarks.length === 0 || open >= 0;
  element("clear-marks").disabled = landmarks.length === 0;
  draw();
}

// Marks in DRRs belong to their pose.
function forgetMarksInDrrs() {
  if (!landmarks.some(one => one.drrs.some(mark => mark))) return;
  for (const one of landmarks) one.drrs = views.map(() => null);
  showLandmarks();
}

async function fit() {
  problem("");
  try {
    const count = landmarks.length;
    const found = await post(kApi + "landmarks", {setup_error: pose, landmarks});
    landmarks.length = 0;
    showLandmarks();
    set(found.setup_error);
    rest();
    element("landmarks").textContent = `Moved by ${count} landmark${count > 1 ? "s" : ""}: ` +
      (count > 1 ? `${found.left_mm.toFixed(1)} mm are left between them (root mean square), ` : "") +
      `the marks of one lie up to ${found.apart_mm.toFixed(1)} mm apart`;
  } catch (error) {
    problem(error.message);
  }
}

// Registration.

// What is compared: one part, and boxes by view.
const region = () => ({part: element("only").checked ? +element("part").value : null, boxes: views.map(view => view.box)});

function problem(text) {
  if (element("problem").textContent !== text) element("problem").textContent = text;
}

function showResult(now) {
  const words = (now.searched ? "Found" : "Kept as it was set") + (now.by === user ? ": " : ` by ${now.by}: `);
  handOverFolder = now.folder;
  const report = make("a", "report", {href: kApi + "results/" + now.folder.split("/").pop() + "/report.html", target: "_blank", rel: "noopener"});
  const line = make("p", words);
  line.append(verdictCell(now.verdict), " ", report);
  const reasons = make("ul");
  for (const reason of now.reasons) reasons.append(make("li", reason));
  element("result").replaceChildren(line, reasons);
  if (!isOfRoom) element("result").append(make("p", "Written to " + now.folder, {class: "dim"}));
  element("hand-over").hidden = !isOfRoom;
}

async function watchRegistration() {
  for (;;) {
    const now = await get(kApi + "state", true);
    const runs = now.state === "runs";
    element("running").hidden = !runs;
    element("optimize").disabled = element("keep").disabled = runs;
    if (now.state === "failed") problem(now.why);
    if (now.state === "ended") {
      showResult(now);
      if (now.searched) {
        set(now.setup_error);
        rest();
      }
    }
    if (!runs) return;
    element("progress").value = now.share;
    element("step-words").textContent = now.step;
    await new Promise(resolve => setTimeout(resolve, kAskMs));
  }
}

// A result of the room becomes a session of its own, which is released like any other.
async function handOver() {
  problem("");
  try {
    const {session: name} = await post(kApi + "hand-over", {folder: handOverFolder});
    element("hand-over").hidden = true;
    const link = make("a", "session " + name, {href: "/session/" + encodeURIComponent(name)});
    const line = make("p", "The engine makes it ");
    line.append(link);
    element("result").replaceChildren(line);
  } catch (error) {
    problem(error.message);
  }
}

async function register(searched) {
  if (!numbers().every(Number.isFinite)) return problem("One of the six numbers is missing.");
  problem("");
  element("hand-over").hidden = true;
  element("result").replaceChildren();
  try {
    await post(kApi + "begin", {setup_error: pose, searched, region: region()});
    await watchRegistration();
  } catch (error) {
    problem(error.message);
  }
}

// The page.

for (const input of document.querySelectorAll("input[name=mode]")) input.addEventListener("change", layOut);
for (const id of ["wipe", "field", "cross", "letters", "xray-brightness", "xray-contrast", "drr-brightness", "drr-contrast"])
  element(id).addEventListener("input", draw);
for (const id of kNumbers)
  element(id).addEventListener("input", () => {
    const six = numbers();
    if (six.every(Number.isFinite)) set(fromNumbers(six.slice(0, 3), six.slice(3)));
  });
element("undo").addEventListener("click", undo);
element("part").addEventListener("change", () => {
  element("only").disabled = element("part").value === "";
  if (element("only").disabled) element("only").checked = false;
  showOutline(pose).catch(error => problem(error.message));
});
element("box").addEventListener("click", () => use("box"));
element("mark").addEventListener("click", () => use("mark"));
element("no-boxes").addEventListener("click", () => {
  for (const view of views) view.box = null;
  on.boxed();
});
element("fit").addEventListener("click", fit);
element("clear-marks").addEventListener("click", () => {
  landmarks.length = 0;
  showLandmarks();
});
element("as-planned").addEventListener("click", () => { set(planned); rest(); });
element("zoom-in").addEventListener("click", () => zoom(true));
element("zoom-out").addEventListener("click", () => zoom(false));
element("optimize").addEventListener("click", () => register(true));
element("keep").addEventListener("click", () => register(false));
element("hand-over").addEventListener("click", handOver);
element("cancel").addEventListener("click", () => post(kApi + "cancel", {}).catch(error => problem(error.message)));
setInterval(() => {
  isFlickered = !isFlickered;
  if (mode() === "flicker") draw();
}, kFlickerMs);

// The room's screen reads a study when somebody asks for it.
async function read() {
  for (;;) {
    try {
      return await get(kApi + "study");
    } catch (error) {
      if (error.status !== kBeingRead) throw error;
      problem(error.message);
      await new Promise(resolve => setTimeout(resolve, kReadMs));
    }
  }
}

try {
  const me = await signedIn();
  user = me.user;
  if (isOfRoom) {
    const mayRegister = me.roles.includes("register");
    for (const one of document.querySelectorAll("#register, .of-register")) one.hidden = !mayRegister;
    element("back").hidden = false;
    element("back").href = "/session/" + session;
    element("back").textContent = "Session " + decodeURIComponent(session);
  }
  const study = await read();
  setStudy(study.id);
  problem("");
  document.title = "isoshift: " + study.patient;
  element("patient").textContent = study.patient;
  element("patient-id").textContent = study.patient_id;
  element("plan").textContent = study.plan && "plan " + study.plan;
  const {data} = await bytes(kApi + "xrays");
  let at = 0;
  for (const view of study.views) {
    const [columns, rows] = view.sizes[0];
    views.push(new ManualView(element("views"), view, data.subarray(at, at += columns * rows), on));
  }
  study.parts.forEach((words, n) => element("part").append(make("option", words, {value: n})));
  pose = restingPose = study.start;
  new ResizeObserver(layOut).observe(element("views"));
  layOut();
  showNumbers();
  ask(kAtRest);
  await watchRegistration();
} catch (error) {
  problem(error.message);
}
