// What a person chooses for a session that waits: which X-rays are one setup, whose they are, and which plan and CT are
// meant.
import {element, follow, get, make, post, showSignedIn} from "/shared.js";

const session = decodeURIComponent(location.pathname.split("/")[2]);
const address = "/api/sessions/" + encodeURIComponent(session);
let shown = "", isOver = false;

const checked = name => [...document.querySelectorAll("input[name=" + name + "]:checked")].map(input => input.value);

function input(type, name, {id, words}, isChecked) {
  const label = make("label", undefined, {class: "line"}), made = make("input", undefined, {type, name, value: id});
  made.checked = isChecked;
  label.append(made, " " + words);
  return label;
}

// The first line leaves it to the files.
function showCandidates(name, candidates, chosen) {
  element(name).parentElement.hidden = candidates.length === 0;
  element(name).replaceChildren(
    ...[{id: "", words: "as the files tell"}, ...candidates].map(one => input("radio", name, one, one.id === chosen)));
}

// Made anew only where the options have changed: what a person has set stays.
function show(options) {
  element("patient").textContent = options.patient;
  element("acquired").textContent = options.acquired;
  if (element("state").textContent !== options.state) element("state").textContent = options.state;
  element("standing").textContent = options.choice;
  element("withdraw").hidden = !options.chosen;
  const {state, choice, ...rest} = options, text = JSON.stringify(rest);
  if (text === shown) return;
  shown = text;
  element("xrays").replaceChildren(...options.own_xrays.map(one => input("checkbox", "xrays", one, true)),
                                   ...options.other_xrays.map(one => input("checkbox", "xrays", one, false)));
  for (const [name, kind] of [["patients", "patient"], ["plans", "plan"], ["cts", "ct"]])
    showCandidates(name, options[name], options.chosen ? options.chosen[kind] : "");
}

async function update(isAutomatic = false) {
  try {
    show(await get(address + "/options", isAutomatic));
    element("problem").textContent = "";
  } catch (error) {
    element("problem").textContent = error.message;
    isOver = error.status === 404;
  }
  enable();
}

function enable() {
  element("withdraw").disabled = isOver || !mayChoose || element("reason").value.trim() === "";
  element("choose").disabled = isOver || !mayChoose || element("reason").value.trim() === "" || checked("xrays").length === 0;
}

element("choice").addEventListener("input", enable);
element("choice").addEventListener("submit", async event => {
  event.preventDefault();
  element("choose").disabled = true;
  element("problem").textContent = "";
  const one = name => checked(name)[0] || "";
  try {
    const {session: made} = await post(address + "/choose", {xrays: checked("xrays"), patient: one("patients"),
      plan: one("plans"), ct: one("cts"), reason: element("reason").value.trim()});
    isOver = true;
    recorded("The engine registers the X-rays as session " + made + ", which ");
  } catch (error) {
    element("problem").textContent = error.message;
  }
  enable();
});

function recorded(what) {
  element("chosen").replaceChildren("Recorded. " + what, make("a", "the list", {href: "/"}), " shows.");
}

element("withdraw").addEventListener("click", async () => {
  element("withdraw").disabled = true;
  element("problem").textContent = "";
  try {
    await post(address + "/withdraw-choice", {reason: element("reason").value.trim()});
    isOver = true;
    recorded("The X-rays are grouped and registered as their files tell, which ");
  } catch (error) {
    element("problem").textContent = error.message;
  }
  enable();
});

element("name").textContent = session;
document.title = "isoshift: choose for " + session;
const me = await showSignedIn(), mayChoose = me.roles.includes("register");
await update();
if (!mayChoose) element("problem").textContent = "You may look, and not choose.";
let version = null;
follow(async now => {
  if (now.version === version || isOver) return;
  version = now.version;
  await update(true);
});
