"use strict";
// The page asks for what there is some times a second and draws it. While it is hidden it asks for nothing.
const $ = (id) => document.getElementById(id);
const OFTEN = 500;
let slot = null;
// The number of a finished scenario that is shown in place of what is driven now.
let chosen = null;
// What the page has already: it asks for what it lacks.
const have = { rows: { generation: 0, all: [], clips: [] }, drive: { generation: 0, points: [], road: [] } };
const tags = {};
const digits = (value, count) => (typeof value === "number" ? value.toFixed(count) : "");
const make = (name, text, attributes = {}) => {
  const element = document.createElement(name);
  element.textContent = text;
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};
const shape = (parent, name, attributes, text) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
};
// Numbers of a point: time, x, z, cross-track error, steering, speed, progress.
const curve = (svg, points, place, least, name) => {
  svg.replaceChildren();
  const known = points.filter((point) => point[place] !== null);
  if (!known.length) return;
  const [from, to] = [known[0][0], Math.max(known.at(-1)[0], known[0][0] + 1)];
  const most = Math.max(least, ...known.map((point) => Math.abs(point[place])));
  const at = (point) => [(60 + (530 * (point[0] - from)) / (to - from)).toFixed(1), (65 - (55 * point[place]) / most).toFixed(1)];
  shape(svg, "line", { class: "zero", x1: 60, x2: 590, y1: 65, y2: 65 });
  for (const [value, y] of [[most, 15], [0, 70], [-most, 125]]) shape(svg, "text", { x: 50, y, "text-anchor": "end", "font-size": 15 }, digits(value, 1));
  for (const [value, x, anchor] of [[from, 60, "start"], [to, 590, "end"]]) shape(svg, "text", { x, y: 145, "text-anchor": anchor, "font-size": 15 }, digits(value, 1) + " s");
  shape(svg, "polyline", { class: "curve", points: known.map(at).join(" ") });
  svg.setAttribute("aria-label", `${name}: ${digits(known.at(-1)[place], 2)} at ${digits(to, 1)} s`);
};
const map = (road, points) => {
  const svg = $("map");
  svg.replaceChildren();
  const all = [...(road ?? []), ...points.map((point) => [point[1], point[2]])];
  if (!all.length) return;
  const low = [0, 1].map((axis) => Math.min(...all.map((point) => point[axis])));
  const high = [0, 1].map((axis) => Math.max(...all.map((point) => point[axis])));
  // The longer side lies across: ahead is to the right, and right is down.
  const across = high[1] - low[1] > high[0] - low[0];
  const [wide, tall] = across ? [1, 0] : [0, 1];
  const scale = Math.min(940 / Math.max(high[wide] - low[wide], 1), 400 / Math.max(high[tall] - low[tall], 1));
  const at = ([x, z]) => across ? [30 + (z - low[1]) * scale, 30 + (x - low[0]) * scale] : [30 + (x - low[0]) * scale, 30 + (high[1] - z) * scale];
  const line = (points) => points.map((point) => at(point).map((value) => value.toFixed(1)).join(",")).join(" ");
  svg.setAttribute("viewBox", `0 0 1000 ${Math.ceil(60 + (high[tall] - low[tall]) * scale)}`);
  if (road?.length) shape(svg, "polyline", { class: "road", points: line(road) });
  const way = points.map((point) => [point[1], point[2]]);
  if (!way.length) return;
  shape(svg, "polyline", { class: "way", points: line(way) });
  const [cx, cy] = at(way.at(-1));
  shape(svg, "circle", { class: "vehicle", cx, cy, r: 11 });
  svg.setAttribute("aria-label", `The road with the vehicle, ${digits(100 * points.at(-1)[6], 0)} % driven`);
};
const drive = ({ road, points = [] }) => {
  curve($("steering"), points, 4, 0.2, "Steering");
  curve($("error"), points, 3, 0.5, "Cross-track error in metres");
  map(road, points);
};
const picture = async (topic, address) => {
  // The one that is shown need not come again.
  const known = tags[topic]?.address === address ? { "if-none-match": tags[topic].tag } : {};
  const answer = await fetch(address, { headers: known });
  const image = $(topic);
  if (answer.status === 304) return;
  const is = answer.ok;
  const tag = answer.headers.get("etag");
  tags[topic] = is && tag ? { address, tag } : undefined;
  if (is) {
    image.src = await new Promise((done) => answer.blob().then((blob) => {
      const reader = new FileReader();
      reader.onload = () => done(reader.result);
      reader.readAsDataURL(blob);
    }));
  }
  image.hidden = !is;
  document.querySelector(`[data-empty="${topic}"]`).hidden = is;
};
const frames = () => Promise.all(["raw", "perturbed"].map((topic) => picture(topic, `frame/${topic}${slot === null ? "" : `?slot=${slot}`}`)));
let images = [];
const still = async () => {
  const [sequence, time] = images[$("frame").value] ?? [];
  $("at").textContent = time === undefined ? "" : `${digits(time, 2)} s`;
  if (sequence === undefined) return;
  const number = chosen;
  await Promise.all(["raw", "perturbed"].map((topic) => picture(topic, `scenario/${number}/${topic}/${sequence}`)));
};
$("frame").addEventListener("input", () => still().catch(trouble));
const show = async (number) => {
  const answer = await fetch(`scenario/${number}`);
  if (!answer.ok) throw new Error(await answer.text());
  const found = await answer.json();
  chosen = number;
  $("shown").textContent = `Scenario ${number}: ${found.name}`;
  drive(found);
  images = found.images;
  $("scrub").hidden = images.length === 0;
  $("frame").max = Math.max(images.length - 1, 0);
  $("frame").value = Math.max(images.length - 1, 0);
  await still();
};
$("now").addEventListener("click", () => { chosen = null; $("scrub").hidden = true; });
const line = (row) => {
  const line = make("tr", "");
  if (row.failed) line.className = "failed";
  const cell = (text, number) => line.append(make("td", text, number ? { class: "n" } : {}));
  cell(row.number, true);
  const name = make("th", "", { scope: "row" });
  const button = make("button", row.name, { type: "button", "data-number": row.number });
  button.addEventListener("click", () => show(row.number).then(() => $("shown").scrollIntoView()).catch(trouble));
  name.append(button);
  line.append(name);
  const outcome = make("td", row.outcome);
  if (row.error) outcome.append(make("br", ""), make("small", row.error));
  line.append(outcome);
  for (const [value, count] of [[row.time, 1], [100 * row.progress, 0], [row.mean, 3], [row.max, 3]]) cell(digits(value, count) + (count === 0 ? " %" : ""), true);
  line.append(make("td", "", { "data-clip": row.number }));
  const again = make("td", "");
  again.append(make("code", row.replay));
  line.append(again);
  return line;
};
const table = ({ generation, from, rows, clips }) => {
  const known = have.rows;
  if (from === 0) {
    const focused = document.activeElement?.dataset?.number;
    $("rows").replaceChildren(...rows.map(line));
    if (focused !== undefined) document.querySelector(`[data-number="${focused}"]`)?.focus();
    known.all = rows;
    known.clips = [];
  } else if (rows.length) {
    $("rows").append(...rows.map(line));
    known.all.push(...rows);
  }
  known.generation = generation;
  for (const number of clips.filter((number) => !known.clips.includes(number))) {
    const cell = document.querySelector(`[data-clip="${number}"]`);
    if (!cell) continue;
    cell.replaceChildren(make("a", "clip", { href: `clips/scenario-${number}.mp4` }));
    known.clips.push(number);
  }
};
// The whole course of the drive under way, of which the answer has what the page lacked.
const course = ({ drive, from = 0, points = [], road }) => {
  const known = have.drive;
  if (from === 0) [known.points, known.road] = [points, road];
  else known.points.push(...points);
  known.generation = drive ?? 0;
  return known;
};
const left = ({ frames, of, seconds }) => {
  if (!frames || of <= frames) return "";
  const rest = ((of - frames) * seconds) / frames;
  const [hours, minutes] = [Math.floor(rest / 3600), Math.floor((rest % 3600) / 60)];
  return `, about ${hours ? `${hours} h ` : ""}${hours || minutes ? `${minutes} min` : `${Math.ceil(rest)} s`} left`;
};
const trouble = (error) => {
  $("trouble").hidden = !error;
  $("trouble").textContent = error ? `${error.message ?? error}` : "";
};
const status = async () => {
  const known = `rows=${have.rows.generation}-${have.rows.all.length}&drive=${have.drive.generation}-${have.drive.points.length}`;
  const answer = await fetch(`status.json?${known}${slot === null ? "" : `&slot=${slot}`}`);
  if (!answer.ok) throw new Error(await answer.text());
  const found = await answer.json();
  table(found.scenarios);
  const scenarios = have.rows.all;
  const driven = course(found.live);
  document.title = `${found.title} – pdk watch`;
  $("title").textContent = found.title;
  $("record").textContent = found.record;
  const done = scenarios.length;
  const failed = scenarios.filter((row) => row.failed).length;
  const progress = found.progress;
  const total = progress?.scenarios ? ` of ${progress.scenarios}` : "";
  $("state").textContent = `${found.under_way ? "Under way" : "Not under way"}: ${done}${total} scenarios done, ${failed} failed${progress ? left(progress) : ""}`;
  $("bar").hidden = !progress;
  if (progress) $("bar").value = progress.of ? progress.frames / progress.of : 0;
  const { slots } = found.live;
  $("slots").replaceChildren(...(slots.length > 1 ? slots : []).map((one) => {
    const button = make("button", `${one.slot}: ${one.name}`, { type: "button", "aria-pressed": one.slot === found.live.slot });
    button.addEventListener("click", () => { slot = one.slot; chosen = null; });
    return button;
  }));
  $("now").hidden = chosen === null || slots.length === 0;
  if (slots.length && chosen === null) {
    $("scrub").hidden = true;
    $("shown").textContent = `Now: ${found.live.name ?? "…"}`;
    drive(driven);
    await frames();
  } else if (!slots.length && chosen === null && done) {
    await show(scenarios.find((row) => row.failed)?.number ?? 0);
  }
  trouble(null);
};
const again = async () => {
  if (!document.hidden) {
    try {
      await status();
    } catch (error) {
      trouble(error instanceof TypeError ? "pdk watch has ended; start it again to go on" : error);
    }
  }
  setTimeout(again, OFTEN);
};
again();
