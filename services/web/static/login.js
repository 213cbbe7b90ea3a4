// Sends name and password; the answer's cookie is out of reach of scripts.

const TIMEOUT_MS = 15000;
const element = (id) => document.getElementById(id);

element("login").addEventListener("submit", async (event) => {
  event.preventDefault();
  element("enter").disabled = true;
  element("said").textContent = "";
  try {
    const response = await fetch("/api/login", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ user: element("user").value.trim(), password: element("password").value }),
      signal: AbortSignal.timeout(TIMEOUT_MS),
    });
    if (response.ok) {
      location.replace("/");
      return;
    }
    element("said").textContent = (await response.json()).error;
  } catch {
    element("said").textContent = "The page does not answer.";
  }
  element("enter").disabled = false;
  element("password").select();
});
