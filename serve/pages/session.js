// A session: its report, what speaks against it, and the release of what is on the screen.
import {bytes, element, follow, get, nameForPeople, post, showSignedIn, verdictCell} from "/shared.js";

const session = decodeURIComponent(location.pathname.split("/").pop());
const address = "/api/sessions/" + encodeURIComponent(session);
const kDecisions = ["agreed", "rejected", "repeat", "reopened"];
let shown = null, me = null, isLoading = false, hasReport = false, engine = "runs";

// Written only where it changes: it is read aloud then.
function write(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}

// The report on the screen is that of the first record. If another one takes its place, a person must look again.
function show(now) {
  if (shown && now.record !== shown.record) {
    write("problem", "The session has another result now. Load this page again to see it.");
    element("release").disabled = true;
    shown = {...shown, obstacle: "The session has another result now."};
    return;
  }
  if (shown && now.objection !== shown.objection) element("despite").checked = false;
  shown = now;
  document.title = "isoshift: " + nameForPeople(now.patient);
  write("patient", nameForPeople(now.patient));
  element("verdict").replaceChildren(verdictCell(now.verdict));
  write("acquired", now.acquired);
  write("state", now.state);
  write("objection", [now.objection, engine === "runs" ? "" :
    "The engine gives no sign of life: whether newer X-rays speak against this result is not known."].filter(one => one).join(" "));
  const needsWord = now.objection !== "";
  element("despite-label").hidden = !needsWord || now.obstacle !== "";
  const may = me.roles.includes("release");
  element("release").disabled = now.obstacle !== "" || !may || !hasReport || (needsWord && !element("despite").checked);
  // Whoever may release decides: with a reason, but who agrees needs none.
  const reason = element("reason").value.trim(), decided = now.decision ? now.decision.kind : "";
  const mayDecide = may && hasReport && now.record !== "";
  element("agreed").disabled = !mayDecide || decided !== "";
  element("rejected").disabled = !mayDecide || reason === "" || decided === "rejected";
  element("repeat").disabled = !mayDecide || reason === "" || decided === "repeat";
  element("reopened").disabled = !mayDecide || reason === "" || decided === "";
  element("choose").hidden = !now.can_choose || !me.roles.includes("register");
  element("newest").hidden = now.newest === session;
  element("newest").href = "/session/" + encodeURIComponent(now.newest);
  element("newest").textContent = "Newest result of these X-rays: session " + now.newest;
  write("goes-to", now.obstacle !== "" ? now.obstacle
    : !may ? "You may look at sessions, and not release them."
    : now.peers.length ? "goes to " + now.peers.join(", ") : "The watch file names no peers: nothing is sent.");
}

async function update(isAutomatic = false) {
  try {
    show(await get(address, isAutomatic));
    return true;
  } catch (error) {
    write("problem", error.message);
    element("release").disabled = true;
    return false;
  }
}

element("despite").addEventListener("change", () => show(shown));

// A frame is loaded, too, when it shows that there was an error.
element("report").addEventListener("load", () => {
  if (!element("report").hasAttribute("src")) return;
  const loads = performance.getEntriesByName(element("report").src).filter(one => one.initiatorType === "iframe");
  hasReport = loads.at(-1)?.responseStatus === 200;
  isLoading = hasReport;
  if (!hasReport) write("problem", "The report could not be loaded.");
  if (shown) show(shown);
});
element("release").addEventListener("click", async () => {
  element("release").disabled = true;
  write("problem", "");
  try {
    await post(address + "/release", {record: shown.record, objection: shown.objection, despite: element("despite").checked});
  } catch (error) {
    write("problem", error.message);
  }
  await update();
});

for (const decision of kDecisions)
  element(decision).addEventListener("click", async () => {
    for (const other of kDecisions) element(other).disabled = true;
    write("problem", "");
    try {
      await post(address + "/decide", {decision, record: shown.record, reason: element("reason").value.trim()});
      element("reason").value = "";
    } catch (error) {
      write("problem", error.message);
    }
    await update();
  });
element("reason").addEventListener("input", () => show(shown));

element("name").textContent = session;
me = await showSignedIn();
element("by-hand").textContent = me.roles.includes("register") ? "Register by hand" : "Look closely";
element("choose").href = "/session/" + encodeURIComponent(session) + "/choose";
element("trend").href = "/session/" + encodeURIComponent(session) + "/trend";
element("by-hand").href = "/session/" + encodeURIComponent(session) + "/by-hand";

// Once the session is there: the engine may have yet to take a result over. report.pdf is kept in the page, so that it
// can be printed while the network is down.
function loadReport() {
  if (!shown || isLoading) return;
  isLoading = true;
  write("problem", "");
  element("report").src = address + "/report.html";
  bytes(address + "/report.pdf").then(({data}) => {
    element("pdf").href = URL.createObjectURL(new Blob([data], {type: "application/pdf"}));
    element("pdf").download = "session-" + session + ".pdf";
  }).catch(error => write("problem", error.message));
}

await update();
loadReport();
let version = null, isAsking = false;
follow(async now => {
  if (engine !== now.engine && shown) {
    engine = now.engine;
    show(shown);
  }
  if (!hasReport) loadReport();
  if (now.version === version || isAsking) return;
  isAsking = true;
  if (await update(true)) version = now.version;
  loadReport();
  isAsking = false;
});
