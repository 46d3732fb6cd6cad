// A study on the screen: a person moves the patient, and the DRRs follow; the same registration as everywhere begins there.
import {bytes, element, kBeingRead, get, make, post, signedIn, verdictCell} from "/shared.js";
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
let wanted = null, isAsking = false, resting = null;
let isFlickered = false;
const views = [];

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
    const painted = draw();
    element("times").textContent = "DRRs of " + views.map(view => view.sizes[asked.detail].join(" x ")).join(", ") + ": rendered in " +
      headers.get("X-Isoshift-Milliseconds") + " ms, painted in " + painted.toFixed(0) + " ms, " +
      (performance.now() - begin).toFixed(0) + " ms in all";
    element("times").dataset.pose = JSON.stringify(asked.pose);  // of what is on the screen
    if (asked.detail === kAtRest) problem("");
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

function showNumbers() {
  const numbers = [...pose.translation_mm, ...anglesDeg(pose)];
  kNumbers.forEach((id, n) => {
    if (document.activeElement !== element(id)) element(id).value = (Math.round(numbers[n] * 100) / 100 || 0).toFixed(2);
  });
}

// The patient is moved; `rest` comes when that has ended.
function set(next) {
  pose = next;
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
  element("undo").disabled = history.length === 0;
  showNumbers();
  ask(kAtRest);
}

// Keys and mouse.

const step = () => +element("step").value;
const on = {
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

// Registration.

function problem(text) {
  if (element("problem").textContent !== text) element("problem").textContent = text;
}

function showResult(now) {
  const words = now.searched ? "Found: " : "Kept as it was set: ";
  const report = make("a", "report", {href: kApi + "report.html", target: "_blank", rel: "noopener"});
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
    const {session: name} = await post(kApi + "hand-over", {});
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
  problem("");
  element("hand-over").hidden = true;
  element("result").replaceChildren();
  try {
    await post(kApi + "begin", {setup_error: pose, searched});
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
    const numbers = kNumbers.map(one => element(one).valueAsNumber);
    if (numbers.every(Number.isFinite)) set(fromNumbers(numbers.slice(0, 3), numbers.slice(3)));
  });
element("undo").addEventListener("click", undo);
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
  await signedIn();
  if (isOfRoom) {
    element("back").hidden = false;
    element("back").href = "/session/" + session;
    element("back").textContent = "Session " + decodeURIComponent(session);
  }
  const study = await read();
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
  pose = restingPose = study.start;
  new ResizeObserver(layOut).observe(element("views"));
  layOut();
  showNumbers();
  ask(kAtRest);
  await watchRegistration();
} catch (error) {
  problem(error.message);
}
