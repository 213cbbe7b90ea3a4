// The WebSocket to the web service: connects, reconnects with back-off, unpacks frames.

const FIRST_RETRY_MS = 250;
const LONGEST_RETRY_MS = 5000;
const SILENT_MS = 3000;
// Four times as long as between two words of the service: what is shown is old by then.
const DOUBTFUL_MS = 800;

export class Link {
  /**
   * @param {(header: object, bitmap: ImageBitmap|null) => Promise<void>} onFrame resolves once drawn;
   *   a null bitmap is a JPEG that the browser could not read
   * @param {Object<string, (note: object) => void>} onNote by the note's type
   */
  constructor(onFrame, onNote) {
    this.onFrame = onFrame;
    this.onNote = onNote;
    this.connected = false;
    this.attempts = 0;
    this.retryAt = 0;
    this.heardAt = 0;
    this.socket = null;
    this.timer = 0;
    // Frames are handled one after the other, so that none is drawn after a newer one.
    this.handled = Promise.resolve();
    addEventListener("online", () => this.retryNow());
    document.addEventListener("visibilitychange", () => document.hidden || this.retryNow());
    setInterval(() => this.checkSilence(), 500);
    this.connect();
  }

  /** Seconds without a word from a service that is still connected; 0 while it speaks. */
  get silentS() {
    const silent = performance.now() - this.heardAt;
    return this.connected && silent > DOUBTFUL_MS ? silent / 1000 : 0;
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heardAt = performance.now();
    socket.onopen = () => { this.connected = true; };
    socket.onmessage = (event) => this.receive(socket, event.data);
    socket.onclose = () => this.lost(socket);
  }

  receive(socket, data) {
    if (socket !== this.socket) return;
    this.attempts = 0;
    this.heardAt = performance.now();
    if (typeof data === "string") {
      const note = JSON.parse(data);
      this.onNote[note.type]?.(note);
      return;
    }
    this.handled = this.handled.then(() => this.show(socket, data)).catch(console.error);
  }

  async show(socket, data) {
    const length = new DataView(data).getUint32(0);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    const jpeg = new Blob([new Uint8Array(data, 4 + length)], { type: "image/jpeg" });
    const bitmap = await createImageBitmap(jpeg).catch(() => null);
    await this.onFrame(header, bitmap);
    bitmap?.close();
    // The service sends at most two frames ahead of this.
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ ack: header.number }));
  }

  // The service speaks five times a second: a silent connection is a dead one, even if the
  // network has not noticed.
  checkSilence() {
    if (!this.socket || document.hidden || performance.now() - this.heardAt < SILENT_MS) return;
    const silent = this.socket;
    this.lost(silent);
    silent.close();
  }

  lost(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    this.connected = false;
    const pause = Math.min(LONGEST_RETRY_MS, FIRST_RETRY_MS * 2 ** this.attempts);
    const jittered = pause * (0.75 + Math.random() / 2);
    this.attempts = Math.min(this.attempts + 1, 10);
    this.retryAt = performance.now() + jittered;
    this.timer = setTimeout(() => this.connect(), jittered);
  }

  retryNow() {
    if (this.socket) return;
    clearTimeout(this.timer);
    this.connect();
  }
}
