// The list of sessions. An update changes rows only: filter, sort, scroll and focus stay as a person has set them.
import {element, follow, get, make, nameForPeople, showSignedIn, verdictCell} from "/shared.js";

const kColumns = [["patient", "Patient"], ["acquired", "Acquired"], ["verdict", "Verdict"], ["action", "Action"],
                  ["state", "State"], ["session", "Session"]];
const kOrder = {failed: 0, waiting: 1, review: 2, rejected: 3, accepted: 4};
let list = {waiting: [], sessions: [], troubles: [], count: 0};
let sortBy = null, descending = false;
const rows = new Map();  // by session

function key(one, column) {
  return column === "verdict" ? String(kOrder[one.verdict] ?? 9) : nameForPeople(one[column]).toLowerCase();
}

// The row of a session, made anew only where what it shows has changed.
function rowOf(one) {
  const text = JSON.stringify(one);
  const before = rows.get(one.session);
  if (before && before.dataset.shows === text) return before;
  const row = make("tr", undefined, {"data-session": one.session});
  row.dataset.shows = text;
  for (const [column] of kColumns) {
    const cell = make("td", undefined, {class: "column-" + column});
    if (column === "verdict") cell.append(verdictCell(one.verdict));
    else if (column === "session" && one.has_result)
      cell.append(make("a", one.session, {href: "/session/" + encodeURIComponent(one.session)}));
    else if (column === "state" && one.has_options)
      cell.append(one.state + " ", make("a", "Choose…", {href: "/session/" + encodeURIComponent(one.session) + "/choose"}));
    else cell.textContent = column === "patient" ? nameForPeople(one.patient) : one[column];
    row.append(cell);
  }
  rows.set(one.session, row);
  return row;
}

function show() {
  const words = element("filter").value.toLowerCase().split(/\s+/).filter(word => word);
  let all = [...list.waiting.map(one => ({...one, has_result: false})),
             ...list.sessions.map(one => ({...one, has_result: true}))];
  all = all.filter(one => {
    const text = kColumns.map(([column]) => nameForPeople(one[column])).join(" ").toLowerCase();
    return words.every(word => text.includes(word));
  });
  if (sortBy) all.sort((a, b) => key(a, sortBy).localeCompare(key(b, sortBy)) * (descending ? -1 : 1));
  const body = element("sessions"), focused = document.activeElement?.closest?.("tr")?.dataset.session;
  const wanted = all.map(rowOf);
  const stays = new Set(wanted);
  for (const row of [...body.children]) if (!stays.has(row)) row.remove();
  for (const [session, row] of rows) if (!stays.has(row) && !all.some(one => one.session === session)) rows.delete(session);
  wanted.forEach((row, n) => {
    if (body.children[n] !== row) body.insertBefore(row, body.children[n] || null);
  });
  if (focused && document.activeElement === document.body) rows.get(focused)?.querySelector("a")?.focus();
  element("count").textContent = all.length + " shown; " + list.count + " with a result, " + list.waiting.length + " waiting";
}

// Written only where it changes: it is read aloud then.
function showTroubles(troubles) {
  const text = troubles.join("\n");
  if (element("troubles").innerText !== text) element("troubles").replaceChildren(...troubles.map(one => make("p", one)));
}

for (const [column, name] of kColumns) {
  const head = make("th", undefined, {scope: "col"}), button = make("button", name);
  button.addEventListener("click", () => {
    descending = sortBy === column && !descending;
    sortBy = column;
    for (const other of element("columns").children) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", descending ? "descending" : "ascending");
    show();
  });
  head.append(button);
  element("columns").append(head);
}
element("filter").addEventListener("input", show);

await showSignedIn();
let isAsking = false;
follow(async now => {
  if (now.version === list.version || isAsking) return;
  isAsking = true;
  try {
    list = await get("/api/room", true);
    element("title").textContent = "Sessions of " + list.site;
    showTroubles(list.troubles);
    show();
  } catch (error) {
    showTroubles(["The list is out of date: " + error.message]);  // asked again with the next sign of life
  }
  isAsking = false;
});
