// What all pages need: elements, requests, who is signed in, and whether the engine runs.

export const element = id => document.getElementById(id);

// An element with text and attributes. Texts of patients go through textContent only: none of them is ever HTML.
export function make(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

export const kBeingRead = 503;  // the status while a study is being read: ask again

let token = "";
let study = "";  // that the page shows

export function setStudy(id) { study = id; }

const ofStudy = () => study ? {"X-Isoshift-Study": study} : {};

async function answered(response) {
  if (response.status === 401) {
    location.assign("/sign-in");
    throw new Error("Nobody is signed in.");
  }
  const body = await response.json().catch(() => ({}));
  if (!response.ok) {
    const error = new Error(body.error || "The server answered with status " + response.status + ".");
    error.status = response.status;
    throw error;
  }
  return body;
}

// `isAutomatic`: the page asks by itself, which does not tell that its user is still there.
export const get = async (path, isAutomatic = false) =>
  answered(await fetch(path, {headers: {...ofStudy(), ...isAutomatic ? {"X-Isoshift-Automatic": "1"} : {}}}));

export const post = async (path, body) => answered(await fetch(path, {
  method: "POST",
  headers: {...ofStudy(), "Content-Type": "application/json", "X-Isoshift-Token": token},
  body: JSON.stringify(body)
}));

// Bytes, and the headers that came with them; of a POST if there is a body.
export async function bytes(path, body) {
  const response = await fetch(path, body === undefined ? {headers: ofStudy()} : {
    method: "POST",
    headers: {...ofStudy(), "Content-Type": "application/json", "X-Isoshift-Token": token},
    body: JSON.stringify(body)
  });
  if (!response.ok) await answered(response);
  return {data: new Uint8Array(await response.arrayBuffer()), headers: response.headers};
}

// Learns who is signed in, and returns that.
export async function signedIn() {
  const me = await get("/api/me");
  token = me.token;
  return me;
}

// The same, shown in the page's head.
export async function showSignedIn() {
  const me = await signedIn();
  element("user").textContent = me.user + " (" + me.roles.join(", ") + ")";
  const out = element("sign-out");
  out.hidden = !me.can_sign_out;
  out.addEventListener("click", async () => {
    await post("/api/sign-out", {});
    location.assign("/sign-in");
  });
  return me;
}

const kSilenceMs = 12000;  // the server speaks every 4 s

// "2026-03-01 10:15:00", local time.
const timeInWords = () => new Date().toLocaleString("sv-SE");

// Calls `changed` with what the server tells: the version of the list, and whether the engine runs. The heartbeat is red
// when the engine gives no sign of life, or when the server has not been heard for some seconds. A page that nobody sees
// does not follow: browsers allow few connections. On paper the page tells of when it is.
export function follow(changed) {
  const heart = element("heartbeat");
  let events = null, silence = null, heardOn = timeInWords();
  const asOf = document.body.appendChild(make("p", "", {class: "printed"}));
  const show = (state, words) => {
    heart.className = state;
    if (heart.textContent !== words) heart.textContent = words;
  };
  const lost = () => show("stopped", "✖ no connection to the server since " + heardOn);
  const hear = event => {
    clearTimeout(silence);
    silence = setTimeout(lost, kSilenceMs);
    const now = JSON.parse(event.data);
    heardOn = timeInWords();
    asOf.textContent = "As the server told it on " + heardOn;
    if (now.engine === "runs") show("runs", "♥ engine runs");
    else show("stopped", "✖ no sign of life from the engine: nothing new is registered or sent");
    changed(now);
  };
  const listen = () => {
    events?.close();
    clearTimeout(silence);
    if (document.hidden) return;
    silence = setTimeout(lost, kSilenceMs);
    events = new EventSource("/api/events");
    events.onmessage = hear;
    events.onerror = () => {
      lost();
      // The stream also ends when the user's time is over: then the next request leads to the sign-in.
      get("/api/me", true).catch(() => {});
    };
  };
  document.addEventListener("visibilitychange", listen);
  listen();
}

// "Doe^Jane (7)" as people write it: "Doe Jane (7)".
export const nameForPeople = text => text.replaceAll("^", " ").replace(/ +/g, " ");

export const verdictCell = verdict => {
  const signs = {accepted: "✔", review: "?", rejected: "✖", failed: "!", waiting: "…"};
  return make("span", (signs[verdict] || "") + " " + verdict, {class: "verdict " + verdict});
};
