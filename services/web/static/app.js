// Puts the parts together: frames to the picture, status to the panel, people's wishes to the service.

import { Above } from "./above.js";
import { Hand } from "./hand.js";
import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { People } from "./people.js";
import { Picture } from "./picture.js";
import { ScreenLock, showLogin } from "./session.js";

const STOP_RETRY_MS = 500;
const REQUEST_TIMEOUT_MS = 3000;
const TICK_MS = 200;

const element = (id) => document.getElementById(id);
const picture = new Picture(element("picture"));
const panel = new Panel();
const people = new People(element("people"), (person) => followPerson(person));
const above = new Above(element("above"));
const hand = new Hand((words, tone) => panel.toast(words, tone), handBack);
const screenLock = new ScreenLock();
// In these the robot moves by itself, or may at any moment.
const ON_ITS_WAY = new Set(["acquiring", "following", "occluded", "unsure", "searching"]);
const nextFrame = () => new Promise(requestAnimationFrame);

const link = new Link(
  async (header, bitmap) => {
    await nextFrame();
    if (!bitmap) return;
    picture.show(header, bitmap);
    panel.showFrame(header);
    people.show(picture.people(), header.target?.id, header.tracker);
    above.showFrame(header);
  },
  {
    status: (status) => {
      panel.update(status);
      panel.tick(link);
      above.showState(status.follower?.state);
      hand.show(status.follower, panel.lost);
      screenLock.keep(hand.drives || ON_ITS_WAY.has(status.follower?.state));
    },
    "sim-world": (world) => above.showWorld(world),
    "sim-truth": (truth) => above.showTruth(truth),
  },
);
showLogin(link);
setInterval(() => {
  panel.tick(link);
  people.tick();
  above.tick();
  element("view-map").hidden = above.stage.hidden;
}, TICK_MS);

async function post(path, body = {}) {
  const response = await fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    signal: AbortSignal.timeout(REQUEST_TIMEOUT_MS),
  });
  const reply = await response.json();
  if (!response.ok) throw new Error(reply.error);
  return reply;
}

async function choose(request) {
  try {
    const target = await post("/api/target", request);
    const awaited = { nearest: "Following the next person in sight", point: "Looking for somebody there" };
    if (target.track_id && /^not sure| % sure/.test(target.reason)) panel.toast(target.reason, "calm");
    else panel.toast(target.track_id ? `Following person ${target.track_id}` : awaited[target.mode] ?? "Following nobody");
  } catch (error) {
    picture.answered();
    panel.toast(error.message, "bad");
  }
}

function followPerson(person, point = {}) {
  // The tracker's name goes along, so that 7 cannot mean another 7 after a restart; and the point,
  // as it decides which of two is meant if they are in one box.
  choose({ mode: "id", track_id: person.id, tracker: person.tracker ?? picture.header.tracker, ...point });
}

// A stop is tried again until the service has it; a resume ends that.
let stopping = 0;

async function stop() {
  if (element("stop").disabled) return;
  stopping += 1;
  const attempt = stopping;
  panel.press();
  while (attempt === stopping) {
    try {
      await post("/api/stop");
      panel.sent();
      return;
    } catch {
      panel.unsentStop = "STOP does not get through to the web service: use the robot\u2019s own switch";
      panel.tick(link);
      panel.showStop();
    }
    await new Promise((resolve) => setTimeout(resolve, STOP_RETRY_MS));
  }
}

async function resume() {
  stopping += 1;
  panel.release();
  try {
    await post("/api/resume");
  } catch (error) {
    panel.toast(error.message, "bad");
  }
}

async function handBack() {
  try {
    await post("/api/hand-back");
  } catch (error) {
    panel.toast(error.message, "bad");
  }
}

picture.canvas.addEventListener("click", (event) => {
  if (!picture.header) return;
  const [x, y] = picture.locate(event);
  const person = picture.personAt(x, y);
  if (person) {
    followPerson(person, { x_px: x, y_px: y });
    return;
  }
  picture.expect(x, y);
  choose({ mode: "point", x_px: x, y_px: y });
});
element("nearest").onclick = () => choose({ mode: "nearest" });
element("none").onclick = () => choose({ mode: "none" });
element("stop").onclick = stop;
element("resume").onclick = resume;
element("view-map").onclick = () => {
  const stages = element("stages");
  const map = stages.dataset.show !== "map";
  stages.dataset.show = map ? "map" : "picture";
  element("view-map").textContent = map ? "Picture" : "Map";
  above.draw();
};
addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !event.repeat) stop();
});
