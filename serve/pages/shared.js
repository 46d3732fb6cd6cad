// What all pages need: elements, requests, who is signed in, and whether the engine runs.

export const element = id => document.getElementById(id);

// An element with text and attributes. Texts of patients go through textContent only: none of them is ever HTML.
export function make(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

let token = "";

async function answered(response) {
  if (response.status === 401) {
    location.assign("/sign-in");
    throw new Error("Nobody is signed in.");
  }
  const body = await response.json().catch(() => ({}));
  if (!response.ok) throw new Error(body.error || "The server answered with status " + response.status + ".");
  return body;
}

export const get = async path => answered(await fetch(path));

export const post = async (path, body) => answered(await fetch(path, {
  method: "POST",
  headers: {"Content-Type": "application/json", "X-Isoshift-Token": token},
  body: JSON.stringify(body)
}));

// Shows who is signed in, and returns that.
export async function signedIn() {
  const me = await get("/api/me");
  token = me.token;
  element("user").textContent = me.user + " (" + me.roles.join(", ") + ")";
  const out = element("sign-out");
  out.hidden = !me.can_sign_out;
  out.addEventListener("click", async () => {
    await post("/api/sign-out", {});
    location.assign("/sign-in");
  });
  return me;
}

// Calls `changed` with the version of the list whenever the server tells of another one. The heartbeat is red when the
// engine has stopped, or when the server has not been heard for some seconds.
export function follow(changed) {
  const heart = element("heartbeat");
  const show = (state, words) => {
    heart.className = state;
    heart.textContent = words;
  };
  const events = new EventSource("/api/events");
  events.onmessage = event => {
    const now = JSON.parse(event.data);
    if (now.engine === "runs") show("runs", "♥ engine runs");
    else show("stopped", "✖ engine stopped: nothing new is registered or sent");
    changed(now.version);
  };
  events.onerror = () => {
    show("stopped", "✖ no connection to the server");
    // The stream also ends when the user's time is over: then the next request leads to the sign-in.
    get("/api/me").catch(() => {});
  };
}

// "Doe^Jane (7)" as people write it: "Doe Jane (7)".
export const nameForPeople = text => text.replaceAll("^", " ").replace(/ +/g, " ");

export const verdictCell = verdict => {
  const signs = {accepted: "✔", review: "?", rejected: "✖", failed: "!", waiting: "…"};
  return make("span", (signs[verdict] || "") + " " + verdict, {class: "verdict " + verdict});
};
