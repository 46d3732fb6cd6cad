// A patient's setup errors over time, with action levels, and what became of each result.
import {element, follow, get, make, nameForPeople, showSignedIn, verdictCell} from "/shared.js";

const session = decodeURIComponent(location.pathname.split("/").at(-2));
const address = "/api/sessions/" + encodeURIComponent(session) + "/trend";
const kComponents = [["x", "mm"], ["y", "mm"], ["z", "mm"], ["about x", "°"], ["about y", "°"], ["about z", "°"]];
const kWidth = 360, kHeight = 190, kLeft = 46, kRight = 10, kTop = 24, kBottom = 26;
const kLong = 30;  // texts that may be broken anywhere

const shown = (value, n) => value === null ? "–" : (Math.round(value * (n < 3 ? 10 : 100)) / (n < 3 ? 10 : 100) || 0).toFixed(n < 3 ? 1 : 2);
const levelOf = (result, n) => result.level ? result.level[n < 3 ? "translation_mm" : "rotation_deg"] : null;

function svg(tag, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// The shape says the verdict, the filling whether the result counts.
function mark(result, x, y) {
  const style = {class: result.verdict, fill: result.left_out ? "#fff" : "currentColor", stroke: "currentColor", "stroke-width": 2};
  return result.verdict === "accepted" ? svg("circle", {...style, cx: x, cy: y, r: 5})
    : result.verdict === "review" ? svg("path", {...style, d: `M${x},${y - 6}l6,11h-12z`})
    : svg("path", {...style, fill: "none", d: `M${x - 5},${y - 5}l10,10m0,-10l-10,10`});
}

function chartOf(results, errors, n) {
  const [name, unit] = kComponents[n];
  const chart = svg("svg", {viewBox: `0 0 ${kWidth} ${kHeight}`, role: "img", "aria-label": `Setup error ${name} in ${unit}, by result`});
  const values = results.map(result => result.components[n]).filter(value => value !== null);
  const levels = results.map(result => levelOf(result, n)).filter(level => level !== null);
  const largest = Math.max(n < 3 ? 2 : 1, ...values.map(Math.abs), ...levels), top = 1.1 * largest;
  const x = k => kLeft + (k + 0.5) * (kWidth - kLeft - kRight) / results.length;
  const y = value => kTop + (1 - value / top) * (kHeight - kTop - kBottom) / 2;
  chart.append(svg("text", {x: kLeft, y: 16, class: "title"}, `${name}, ${unit}`));
  if (errors && errors.random) {
    const [mean, sd] = [errors.systematic[n], errors.random[n]];
    chart.append(svg("rect", {x: kLeft, width: kWidth - kLeft - kRight, y: y(mean + sd), height: y(mean - sd) - y(mean + sd), fill: "#ddd"}));
  }
  for (const value of [-largest, 0, largest]) {
    chart.append(svg("line", {x1: kLeft, x2: kWidth - kRight, y1: y(value), y2: y(value), stroke: value === 0 ? "#111" : "#ccc"}));
    chart.append(svg("text", {x: kLeft - 6, y: y(value) + 4, "text-anchor": "end"}, shown(value, n)));
  }
  const half = (kWidth - kLeft - kRight) / results.length / 2;
  results.forEach((result, k) => {
    const level = levelOf(result, n);
    if (level !== null)
      for (const sign of [-1, 1])
        chart.append(svg("line", {x1: x(k) - half, x2: x(k) + half, y1: y(sign * level), y2: y(sign * level), stroke: "#b30000", "stroke-width": 2, "stroke-dasharray": "6 4"}));
  });
  results.forEach((result, k) => {
    const value = result.components[n];
    if (value === null) return;
    const point = mark(result, x(k), y(value));
    point.append(svg("title", {}, `${result.first}: ${shown(value, n)} ${unit}, ${result.verdict}`));
    chart.append(point);
  });
  const first = results[0].first.slice(0, 10), last = results.at(-1).first.slice(0, 10);
  chart.append(svg("text", {x: kLeft, y: kHeight - 8}, first));
  if (last !== first) chart.append(svg("text", {x: kWidth - kRight, y: kHeight - 8, "text-anchor": "end"}, last));
  return chart;
}

function rowOf(cells) {
  const row = make("tr");
  for (const cell of cells) {
    const made = make("td", undefined, typeof cell === "string" && cell.length > kLong ? {class: "column-state"} : {});
    made.append(cell);
    row.append(made);
  }
  return row;
}

function show({results, errors}) {
  const patient = nameForPeople(results[0].patient);
  document.title = "isoshift: trend of " + patient;
  element("patient").textContent = patient;
  element("charts").replaceChildren(...kComponents.map((_, n) => chartOf(results, errors, n)));
  element("errors").replaceChildren();
  if (errors) {
    element("errors").append(rowOf(["Systematic (mean)", String(errors.fractions), ...errors.systematic.map(shown)]));
    element("errors").append(rowOf(["Random (standard deviation)", String(errors.fractions),
                                    ...kComponents.map((_, n) => errors.random ? shown(errors.random[n], n) : "–")]));
  }
  element("results").replaceChildren(...results.map(result => rowOf([
    make("a", result.first || "unknown", {href: "/session/" + encodeURIComponent(result.session)}), result.plan,
    verdictCell(result.verdict), ...result.components.map(shown), result.action, result.state,
    result.left_out ? "no: " + result.left_out : "yes"])));
}

for (const title of ["", "Results", ...kComponents.map(([name, unit]) => name + ", " + unit)])
  element("systematic-columns").append(make("th", title, {scope: "col"}));
for (const title of ["Acquired", "Plan", "Verdict", ...kComponents.map(([name, unit]) => name + ", " + unit), "Action", "State", "Counts"])
  element("columns").append(make("th", title, {scope: "col"}));
element("back").href = "/session/" + encodeURIComponent(session);
await showSignedIn();

async function update(isAutomatic) {
  try {
    show(await get(address, isAutomatic));
    element("problem").textContent = "";
    return true;
  } catch (error) {
    element("problem").textContent = error.message;
    return false;
  }
}

await update(false);
let version = null, isAsking = false;
follow(async now => {
  if (now.version === version || isAsking) return;
  isAsking = true;
  if (await update(true)) version = now.version;
  isAsking = false;
});
