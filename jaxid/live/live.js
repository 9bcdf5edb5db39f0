(() => {
  // Parts of the page are fetched when the server says that they have changed; files are sent to it one by one.
  const main = document.querySelector("main"), drop = document.getElementById("drop"), link = document.getElementById("link");
  const refused = document.getElementById("refused"), numbers = {}, wanted = {};
  const draw = async name => {
    const number = wanted[name], body = document.querySelector(`#${name} .body`);
    const answer = await fetch(`/part/${name}`);
    if (!answer.ok || number !== wanted[name]) return;
    const open = [...body.querySelectorAll("details")].map(d => [d.querySelector("summary").textContent, d.open]);
    body.innerHTML = await answer.text();  // the server has escaped it, and no script in it would run
    for (const [title, was] of open) for (const d of body.querySelectorAll("details"))
      if (d.querySelector("summary").textContent === title) d.open = was;
    numbers[name] = number;
    dispatchEvent(new Event("jaxid-drawn"));
  };
  const show = seen => {
    for (const [name, part] of Object.entries(seen.parts)) {
      const section = document.getElementById(name);
      section.dataset.state = part.state;
      section.querySelector(".state").textContent = part.words;
      const step = document.querySelector(`nav [data-of="${name}"]`);
      step.dataset.state = part.state;
      step.querySelector("span").textContent = part.state === "running" ? part.words : part.state === "failed" ? "failed" : "";
      if (part.number !== (wanted[name] || 0)) { wanted[name] = part.number; draw(name); }
    }
  };
  const listen = () => {
    const events = new EventSource("/events");
    events.onopen = () => { link.textContent = "following the folder"; };
    events.onmessage = event => show(JSON.parse(event.data));
    events.onerror = () => { link.textContent = "not connected: is jaxid serve still running?"; };
    addEventListener("beforeunload", () => events.close());
  };
  const complain = text => {
    const item = document.createElement("li");
    item.textContent = text;
    refused.append(item);
  };
  const send = async files => {
    refused.replaceChildren();
    for (const file of files) {
      if (file.size > Number(main.dataset.largest)) {
        complain(`${file.name} is ${(file.size / 1e6).toPrecision(4)} MB; the page takes logs up to ` +
          `${(main.dataset.largest / 1e6).toPrecision(4)} MB: copy it into the folder instead.`);
        continue;
      }
      try {
        const answer = await fetch(`/logs/${encodeURIComponent(file.name)}`, { method: "POST", body: file, headers: { "X-Jaxid": "1" } });
        if (!answer.ok) complain(await answer.text());
      } catch (error) { complain(`${file.name} did not arrive; is jaxid serve still running?`); }
    }
  };
  document.getElementById("files").addEventListener("change", event => { send([...event.target.files]); event.target.value = ""; });
  for (const kind of ["dragover", "dragleave", "drop"]) addEventListener(kind, event => {
    event.preventDefault();
    drop.classList.toggle("over", kind === "dragover");
    if (kind === "drop") send([...event.dataTransfer.files]);
  });
  listen();
})();
