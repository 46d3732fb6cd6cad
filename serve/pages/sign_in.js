// Signs in, and goes on to the list of sessions.
import {element, post} from "/shared.js";

element("form").addEventListener("submit", async event => {
  event.preventDefault();
  element("problem").textContent = "";
  try {
    await post("/api/sign-in", {user: element("user").value, password: element("password").value});
    location.assign("/");
  } catch (error) {
    element("problem").textContent = error.message;
    element("password").value = "";
    element("password").focus();
  }
});
