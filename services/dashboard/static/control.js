// The buttons; they exist only when the server was started with --allow-control, and work only with its token.
export class Control {
  constructor() {
    const given = new URLSearchParams(location.hash.slice(1)).get("token");
    if (given) sessionStorage.setItem("token", given);
    if (given) history.replaceState(null, "", location.pathname);
    this.token = sessionStorage.getItem("token");
    this.shown = "";
  }

  show(requests) {
    if (requests.join() === this.shown) return;
    this.shown = requests.join();
    document.getElementById("control").hidden = !requests.length;
    
    const box = document.getElementById("buttons");
    box.replaceChildren();
    this.say(this.token ? "" : "the link that the server printed is needed: it holds the token");
    for (const request of this.token ? requests : []) {
      const button = document.createElement("button");
      button.textContent = request;
      button.className = request;
      button.onclick = () => this.press(button, request);
      box.append(button);
    }
  }

  press(button, request) {
    if (request === "arm" && !button.classList.contains("sure")) {
      button.classList.add("sure");
      button.textContent = "sure?";
      setTimeout(() => {
        button.classList.remove("sure");
        button.textContent = request;
      }, 3000);
      return;
    }
    this.ask(request);
  }

  async ask(request) {
    const headers = { Authorization: `Bearer ${this.token}`, "Content-Type": "application/json" };
    try {
      const answer = await fetch("/api/request", { method: "POST", headers, body: JSON.stringify({ request }) });
      const said = await answer.json();
      this.say(answer.ok ? `asked to ${request}; the guard answers by its state` : said.error);
    } catch (error) {
      this.say(`not sent: ${error.message}`);
    }
  }

  say(text) {
    document.getElementById("control-said").textContent = text;
  }
}
