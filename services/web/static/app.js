// Puts the parts together: frames to the picture, status to the panel, people's wishes to the service.

import { Above } from "./above.js";
import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";

const STOP_RETRY_MS = 500;
const REQUEST_TIMEOUT_MS = 3000;
const TICK_MS = 200;

const picture = new Picture(document.getElementById("picture"));
const panel = new Panel((person) => followPerson(person));
const above = new Above(document.getElementById("above"));
const nextFrame = () => new Promise(requestAnimationFrame);

const link = new Link(
  async (header, bitmap) => {
    await nextFrame();
    if (!bitmap) return;
    picture.show(header, bitmap);
    panel.showFrame(header, picture.people());
    above.showFrame(header);
  },
  {
    status: (status) => {
      panel.update(status);
      above.showState(status.follower?.state);
    },
    "sim-world": (world) => above.showWorld(world),
    "sim-truth": (truth) => above.showTruth(truth),
  },
);
setInterval(() => {
  panel.tick(link);
  above.tick();
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
    const who = target.track_id ? `Following person ${target.track_id}` : "Following nobody";
    panel.toast(target.mode === "nearest" && !target.track_id ? "Following the next person in sight" : who);
  } catch (error) {
    panel.toast(error.message, "bad");
  }
}

function followPerson(person) {
  // The tracker's name goes along, so that 7 cannot mean another 7 after a restart.
  choose({ mode: "id", track_id: person.id, tracker: picture.header.tracker });
}

// A stop is tried again until the service has it; a resume ends that.
let stopping = 0;

async function stop() {
  stopping += 1;
  const attempt = stopping;
  while (attempt === stopping) {
    try {
      await post("/api/stop");
      panel.unsentStop = "";
      return;
    } catch {
      panel.unsentStop = "STOP does not get through to the web service: use the robot\u2019s own switch";
      panel.tick(link);
    }
    await new Promise((resolve) => setTimeout(resolve, STOP_RETRY_MS));
  }
}

async function resume() {
  stopping += 1;
  panel.unsentStop = "";
  try {
    await post("/api/resume");
  } catch (error) {
    panel.toast(error.message, "bad");
  }
}

picture.canvas.addEventListener("click", (event) => {
  if (!picture.header) return;
  const [x, y] = picture.locate(event);
  const person = picture.personAt(x, y);
  if (person) followPerson(person);
  else choose({ mode: "point", x_px: x, y_px: y });
});
document.getElementById("nearest").onclick = () => choose({ mode: "nearest" });
document.getElementById("none").onclick = () => choose({ mode: "none" });
document.getElementById("stop").onclick = stop;
document.getElementById("resume").onclick = resume;
addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !event.repeat) stop();
});
