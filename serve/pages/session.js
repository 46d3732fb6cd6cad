// A session: its report, what speaks against it, and the release of what is on the screen.
import {element, follow, get, make, nameForPeople, post, signedIn, verdictCell} from "/shared.js";

const session = decodeURIComponent(location.pathname.split("/").pop());
const address = "/api/sessions/" + encodeURIComponent(session);
let shown = null, me = null;

// The report on the screen is that of the first record. If another one takes its place, a person must look again.
function show(now) {
  if (shown && now.record !== shown.record) {
    element("problem").textContent = "The session has another result now. Load this page again to see it.";
    element("release").disabled = true;
    return;
  }
  shown = now;
  document.title = "isoshift: " + nameForPeople(now.patient);
  element("patient").textContent = nameForPeople(now.patient);
  element("verdict").replaceChildren(verdictCell(now.verdict));
  element("acquired").textContent = now.acquired;
  element("state").textContent = now.state;
  element("objection").textContent = now.objection;
  const needsWord = now.objection !== "" && !now.newer_have_results;
  element("despite-label").hidden = !needsWord || now.obstacle !== "";
  const may = me.roles.includes("release");
  element("release").disabled = now.obstacle !== "" || !may || (needsWord && !element("despite").checked);
  element("goes-to").textContent = now.obstacle !== "" ? now.obstacle
    : !may ? "You may look at sessions, and not release them."
    : now.peers.length ? "goes to " + now.peers.join(", ") : "The watch file names no peers: nothing is sent.";
}

async function update() {
  try {
    show(await get(address));
  } catch (error) {
    element("problem").textContent = error.message;
    element("release").disabled = true;
  }
}

element("despite").addEventListener("change", () => show(shown));
element("release").addEventListener("click", async () => {
  element("release").disabled = true;
  element("problem").textContent = "";
  try {
    show(await post(address + "/release", {record: shown.record, despite: element("despite").checked}));
  } catch (error) {
    element("problem").textContent = error.message;
    await update();
  }
});

element("name").textContent = session;
element("pdf").href = address + "/report.pdf";
me = await signedIn();
await update();
element("report").src = address + "/report.html";
let version = null;
follow(async now => {
  if (now === version) return;
  version = now;
  await update();
});
