// The list of robots: asks once a second, and draws one card for each.

import { showLogin } from "./session.js";

const EVERY_MS = 1000;
const TIMEOUT_MS = 3000;
// Longer than the service's own looks at the robots: what is shown is old by then.
const STALE_S = 2;
const TONES = {
  following: "good", acquiring: "calm", occluded: "warn", searching: "warn", unsure: "warn", lost: "warn",
};
const element = (id) => document.getElementById(id);
const link = { connected: true };

function made(tag, className, text, tone) {
  const node = document.createElement(tag);
  node.className = className;
  node.textContent = text;
  if (tone) node.dataset.tone = tone;
  return node;
}

const isLoopback = (host) => host === "localhost" || host === "[::1]" || host.startsWith("127.");

/** A link to a robot's own page; one that listens on loopback is of use on its own host only. */
function pageOf(robot) {
  if (!robot.page) return made("span", "label", "serves no page");
  const there = new URL(robot.page);
  if (isLoopback(there.hostname) && !isLoopback(location.hostname)) {
    return made("span", "label", "page on its own host only");
  }
  const anchor = made("a", "robot-page", robot.page);
  anchor.href = there.href;
  anchor.rel = "noreferrer";
  return anchor;
}

function pill(robot) {
  const { drive, follower } = robot.estop_of;
  if (robot.estop) {
    const apart = drive !== null && follower !== null && drive !== follower;
    return made("span", "pill", apart ? `STOP: ${drive ? "drive" : "follower"} only` : "STOP", "bad");
  }
  if (robot.problems.length) return made("span", "pill", "lacks something", "bad");
  return made("span", "pill", robot.state ?? "says nothing", TONES[robot.state]);
}

function figures(robot) {
  const told = [];
  if (robot.target !== undefined) told.push(robot.target === "none" ? "nobody chosen" : `target ${robot.target}`);
  if (robot.identity_confidence != null) told.push(`${Math.round(100 * robot.identity_confidence)} % sure`);
  if (robot.distance_m != null) told.push(`${robot.distance_m.toFixed(1)} m away`);
  if (robot.linear_mps !== undefined) told.push(`${robot.linear_mps.toFixed(2)} m/s`);
  if (robot.frames_per_s != null) told.push(`${robot.frames_per_s.toFixed(1)} frames/s`);
  if (robot.tracks_age_s != null) told.push(`${Math.round(1000 * robot.tracks_age_s)} ms old`);
  return told.join(", ");
}

function card(robot) {
  const item = document.createElement("li");
  item.className = "card";
  item.dataset.robot = robot.name;
  const head = document.createElement("div");
  head.className = "robot-head";
  head.append(made("b", "", robot.name || "(no name)"), pill(robot), pageOf(robot));
  item.append(head);
  if (robot.reason) item.append(made("p", "reason", `${robot.state}: ${robot.reason}`));
  const told = figures(robot);
  if (told) item.append(made("p", "label", told));
  for (const problem of robot.problems) item.append(made("p", "robot-problem", problem.words));
  for (const note of robot.notes) item.append(made("p", "robot-note", note));
  return item;
}

function show(status) {
  const lacking = status.robots.filter((robot) => robot.problems.length).length;
  const stopped = status.robots.filter((robot) => robot.estop).length;
  element("robots").replaceChildren(...status.robots.map(card));
  element("none-heard").hidden = !status.router || status.robots.length > 0;
  element("figures").textContent = `${status.robots.length} robots: ${lacking} wrong, ${stopped} stopped`;
  const late = status.status_age_s > STALE_S;
  say(late ? "the list hangs" : status.router ? "live" : "router away", late || !status.router ? "bad" : "good");
}

function say(words, tone) {
  element("link").textContent = words;
  element("link").dataset.tone = tone;
  document.body.toggleAttribute("data-lost", tone === "bad");
}

async function look() {
  try {
    const response = await fetch("/api/robots", { signal: AbortSignal.timeout(TIMEOUT_MS) });
    if (response.status === 401) location.replace("/login.html");
    if (!response.ok) throw new Error(response.statusText);
    show(await response.json());
    link.connected = true;
  } catch {
    link.connected = false;
    say("page does not answer", "bad");
  }
  setTimeout(look, EVERY_MS);
}

showLogin(link);
look();
