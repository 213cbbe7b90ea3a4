// Who is logged in, and what that lets them do; and back to the login once it is over.

const LOOK_MS = 3000;

/** What a viewer may do. @returns {Promise<{login: boolean, user?: string, role?: string}>} */
async function session() {
  const response = await fetch("/api/session");
  if (response.status === 401) location.replace("/login.html");
  return response.ok ? response.json() : { login: false };
}

/** Shows who is logged in; those that only watch get no buttons that would be refused. */
export async function showLogin(link) {
  setInterval(() => { if (!link.connected) session().catch(() => {}); }, LOOK_MS);
  const { login, user, role } = await session().catch(() => ({ login: false }));
  if (!login) return;
  document.body.dataset.role = role;
  const button = document.getElementById("logout");
  button.textContent = `${user}: log out`;
  button.title = role === "watch" ? "logged in to watch" : "logged in to operate";
  button.hidden = false;
  button.onclick = async () => {
    await fetch("/api/logout", { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" });
    location.replace("/login.html");
  };
  if (role !== "watch") return;
  for (const id of ["stop", "resume", "nearest", "none", "take", "hand-back"]) {
    const refused = document.getElementById(id);
    if (refused) refused.disabled = true;
  }
}

/** Keeps the phone's screen on while the robot moves by itself; browsers allow it over TLS only. */
export class ScreenLock {
  constructor() {
    this.lock = null;
    this.wanted = false;
    document.addEventListener("visibilitychange", () => this.keep(this.wanted));
  }

  async keep(wanted) {
    this.wanted = wanted;
    if (wanted && !this.lock && !document.hidden && navigator.wakeLock) {
      const asked = this.lock = {};
      try {
        this.lock = await navigator.wakeLock.request("screen");
        this.lock.addEventListener("release", () => { this.lock = null; });
      } catch {
        // A phone that saves its battery says no.
        if (this.lock === asked) this.lock = null;
      }
    }
    if (!this.wanted && this.lock?.release) {
      await this.lock.release();
      this.lock = null;
    }
  }
}
