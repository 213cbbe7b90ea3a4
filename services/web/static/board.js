// Holding up a board: the picture, the corners found in it, what is covered, and where it is wanted next.

const EVERY_MS = 120;
const TIMEOUT_MS = 3000;
const COVERED = "#4fd1a5", WANTED = "#ffb454", LINE = "#e8eef433";
const element = (id) => document.getElementById(id);
const canvas = element("picture");
let shown = 0;

function say(words, tone) {
  element("link").textContent = words;
  element("link").dataset.tone = tone;
}

/** Cells of the picture: green where corners were seen, amber and dashed where the board is wanted next. */
function drawCells(context, state) {
  const rows = state.covered.length, columns = state.covered[0].length;
  const width = canvas.width / columns, height = canvas.height / rows;
  context.lineWidth = Math.max(2, canvas.width / 320);
  state.covered.forEach((row, down) => row.forEach((covered, across) => {
    const place = [across * width, down * height, width, height];
    if (covered) {
      context.fillStyle = `${COVERED}2e`;
      context.fillRect(...place);
    }
    context.strokeStyle = LINE;
    context.strokeRect(...place);
  }));
  if (!state.wanted) return;
  const [down, across] = state.wanted;
  const inset = context.lineWidth;
  context.strokeStyle = WANTED;
  context.setLineDash([inset * 5, inset * 3]);
  context.lineWidth = inset * 2;
  context.strokeRect(across * width + inset, down * height + inset, width - 2 * inset, height - 2 * inset);
  context.setLineDash([]);
}

function drawCorners(context, state) {
  const scale = canvas.width / state.width;
  context.fillStyle = state.kept ? COVERED : WANTED;
  for (const [x, y] of state.corners) {
    context.beginPath();
    context.arc(x * scale, y * scale, Math.max(2.5, canvas.width / 240), 0, 2 * Math.PI);
    context.fill();
  }
}

async function draw(state) {
  const response = await fetch(`/board.jpg?${state.number}`, { signal: AbortSignal.timeout(TIMEOUT_MS) });
  if (!response.ok) throw new Error(response.statusText);
  const picture = await createImageBitmap(await response.blob());
  canvas.width = picture.width;
  canvas.height = picture.height;
  const context = canvas.getContext("2d");
  context.drawImage(picture, 0, 0);
  picture.close();
  drawCells(context, state);
  drawCorners(context, state);
  canvas.dataset.number = state.number;
  canvas.dataset.covered = state.covered.flat().filter(Boolean).length;
}

async function show(state) {
  if (state.number && state.number !== shown) {
    await draw(state);
    shown = state.number;
  }
  if (state.number) {
    const cells = state.covered.flat();
    const covered = Math.round(100 * cells.filter(Boolean).length / cells.length);
    element("figures").textContent = `${state.views} of at least ${state.least} views, ${covered} % covered`;
    element("seen").textContent = state.seen;
  }
  element("next").textContent = state.result ?? state.next ?? "";
  element("next").dataset.tone = state.result ? "calm" : state.wanted ? "warn" : "good";
}

async function look() {
  try {
    const response = await fetch("/api/board", { signal: AbortSignal.timeout(TIMEOUT_MS) });
    if (!response.ok) throw new Error(response.statusText);
    const state = await response.json();
    await show(state);
    if (state.result) {
      say("ended", "calm");
      return;
    }
    say("live", "good");
  } catch {
    say("page does not answer", "bad");
  }
  setTimeout(look, EVERY_MS);
}

look();
