// node walk.js URL OUT ROOT: the pages of `kolsky open` as a person uses them: a shot from raw files to its answer,
// by mouse and keyboard; a picture of each view and axe-core at 1280 and 390 px; a film's frames; a hostile page
// in the same browser; a server that is killed. SERVER: its process number and the words that start it again.
// Prints one JSON object.
const { spawn } = require("child_process");
const http = require("http");
const fs = require("fs");
const path = require("path");
const puppeteer = require("puppeteer-core");
const axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const [url, out, root] = process.argv.slice(2);
const found = { problems: [], outside: [], baseline: "", log: "", film: [], hostile: {}, states: {} };
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// A tab that waits as long as a busy computer needs.
async function tab(browser) {
  const page = await browser.newPage();
  page.setDefaultTimeout(180000);
  page.setDefaultNavigationTimeout(180000);
  return page;
}

// Waits for words; a page that is built anew meanwhile, as after a lost connection, is looked at again.
async function see(page, words, seconds = 120) {
  const until = Date.now() + 1000 * seconds;
  for (;;) {
    const left = until - Date.now();
    if (left <= 0) break;
    const seen = await page
      .waitForFunction((t) => new RegExp(t).test(document.body.innerText), { timeout: left, polling: 200 }, words)
      .then(() => true, () => false);
    if (seen) return;
    await pause(500);
  }
  throw new Error(`did not see: ${words}: ${await page.evaluate(() => document.body.innerText.slice(0, 1500)).catch(String)}`);
}

async function looked(page, name, widths = [1280, 390]) {
  for (const width of widths) {
    await page.setViewport({ width, height: width < 600 ? 844 : 900 });
    await pause(1200);
    const beyond = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    if (beyond > 0) found.problems.push(`${name} ${width}: ${beyond} px wider than the screen`);
    await page.screenshot({ path: path.join(out, `${name}-${width}.png`), fullPage: width < 600 || name !== "setup" });
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => axe.run(document));
    for (const v of violations) found.problems.push(`${name} ${width}: axe ${v.id}: ${v.nodes[0].html.slice(0, 160)}`);
  }
  await page.setViewport({ width: 1280, height: 900 });
}

// One picture of the film, its caption and how long it stays.
async function film(page, words, seconds = 1.6) {
  const name = `film-${String(found.film.length).padStart(2, "0")}.png`;
  await page.screenshot({ path: path.join(out, name) });
  found.film.push([name, words, seconds]);
}

async function to(page, selector) {
  const one = await page.waitForSelector(selector);
  await one.evaluate((e) => e.scrollIntoView({ block: "center" }));
  await pause(900);
  return one;
}

async function choose(page, label, option) {
  const field = await page.waitForFunction((t) => [...document.querySelectorAll(".q-select")]
    .find((one) => one.querySelector(".q-field__label")?.innerText === t), {}, label);
  await field.click();
  await page.waitForFunction((v) => [...document.querySelectorAll(".q-menu .q-item")].some((i) => i.innerText.trim() === v), {}, option);
  await pause(300);
  await page.evaluate((v) => [...document.querySelectorAll(".q-menu .q-item")].find((i) => i.innerText.trim() === v).click(), option);
  await pause(500);
}

const declared = (page, key) => page.$eval("textarea", (one, k) => one.value.match(new RegExp(`^${k} = "(.*?)"`, "m"))[1], key);

// Waits until the text of a tab declares a value.
const declares = (page, key, value) => page.waitForFunction(
  (k, v) => new RegExp(`^${k} = "${v}"`, "m").test(document.querySelector("textarea").value), {}, key, value);

// What a page of another server of this computer reaches in the same browser, which has the secret's cookie.
async function hostile(browser, origin) {
  const server = http.createServer((_, answer) => { answer.setHeader("content-type", "text/html"); answer.end("<h1>prizes</h1>"); });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const page = await tab(browser);
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  const reached = await page.evaluate(async (target) => {
    const got = {};
    const words = async (way, more) => { got[way] = await fetch(target, more).then((r) => (r.type === "opaque" ? "opaque" : `read ${r.status}`), () => "refused"); };
    await words("read", { credentials: "include" });
    await words("read blindly", { credentials: "include", mode: "no-cors" });
    await words("post", { credentials: "include", mode: "no-cors", method: "POST", body: "x" });
    got.websocket = await new Promise((resolve) => {
      const line = new WebSocket(`${target.replace("http", "ws")}/_nicegui_ws/socket.io/?EIO=4&transport=websocket`);
      line.onopen = () => resolve("open");
      line.onerror = () => resolve("refused");
    });
    const inside = document.createElement("iframe");
    inside.src = target;
    document.body.append(inside);
    await new Promise((resolve) => { inside.onload = resolve; setTimeout(resolve, 4000); });
    try { got.frame = inside.contentWindow.document.body.innerText ? "read" : "empty"; } catch { got.frame = "refused"; }
    return got;
  }, origin);
  const other = await page.goto(`http://evil.example:${new URL(origin).port}/`).catch(() => null); // a name pointed here
  reached["another name"] = other === null ? "refused" : `status ${other.status()}`;
  await page.close();
  server.close();
  return reached;
}

// A second tab changes the shot; the first one's change is refused and nothing is lost.
async function twoTabs(browser, page, address) {
  const other = await tab(browser);
  await other.setViewport({ width: 1280, height: 900 });
  await other.goto(address, { waitUntil: "networkidle2" });
  await fill(other, "specimen.length", "6.6 mm");
  await see(other, "Every value is filled in", 90);
  await page.bringToFront();
  await fill(page, "specimen.density", "880 kg/m^3");
  await see(page, "was changed by another page", 90);
  await press(page, "Read the file again");
  await declares(page, "length", "6.6 mm");
  found.states.tabs = [await declared(page, "length"), await declared(page, "density")];
  await other.bringToFront();
  await press(other, "Undo");
  await declares(other, "length", "6.5 mm");
  await other.close();
  await page.bringToFront();
  await press(page, "Read the file again");
  await declares(page, "length", "6.5 mm");
}

// The server dies at once, without a word; another one is started over the same folder.
async function killed(page) {
  const { process: number, words } = JSON.parse(process.env.SERVER);
  process.kill(number, "SIGKILL");
  await pause(1000);
  const server = spawn(words[0], words.slice(1), { stdio: ["ignore", "pipe", "inherit"] });
  const text = await new Promise((resolve) => {
    let said = "";
    server.stdout.on("data", (part) => { said += part; if (said.split("\n").length > 2) resolve(said); });
  });
  const url = text.split("\n")[1].trim();
  for (let i = 0; i < 60; i += 1) {
    const there = await page.goto(url, { waitUntil: "networkidle2" }).then(() => true, () => false);
    if (there) break;
    await pause(500);
  }
  return server;
}

async function press(page, words) {
  await page.evaluate((t) => {
    const all = [...document.querySelectorAll("button")].filter((one) => one.innerText.trim().split("\n").pop() === t); // an icon is a word too
    all[0].click();
  }, words);
}

async function fill(page, key, value) {
  const selector = `[data-key="${key}"]`;
  const field = await page.waitForSelector(selector);
  const closed = await field.evaluate((one) => one.getClientRects().length === 0); // its table is folded
  if (closed) await field.evaluate((one) => one.closest(".q-expansion-item").querySelector(".q-item").click());
  await pause(closed ? 900 : 0);
  await field.evaluate((one) => one.scrollIntoView({ block: "center" }));
  const select = await field.evaluate((one) => one.closest(".q-select") !== null || one.classList.contains("q-select"));
  await pause(150);
  if (select) {
    await (await field.evaluateHandle((one) => one.closest(".q-field"))).click();
    await page.waitForFunction((v) => [...document.querySelectorAll(".q-menu .q-item")].some((i) => i.innerText.trim() === v), {}, value);
    await pause(300);
    await page.evaluate((v) => [...document.querySelectorAll(".q-menu .q-item")].find((i) => i.innerText.trim() === v).click(), value);
  } else {
    const input = (await field.evaluate((one) => one.tagName)) === "INPUT" ? field : await field.$("input");
    await input.click({ clickCount: 3 });
    await input.type(value);
    await page.keyboard.press("Tab");
  }
  await pause(400);
}

let second = null;

(async () => {
  const typed = JSON.parse(fs.readFileSync(path.join(out, "typed.json"), "utf8"));
  const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM || "/usr/bin/chromium", headless: true,
    args: ["--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP evil.example 127.0.0.1"],
  });
  const page = await tab(browser);
  const origin = new URL(url).origin;
  let gone = false; // the server was killed: the browser complains
  page.on("console", (m) => m.type() === "error" && !gone && found.problems.push("console: " + m.text().slice(0, 200)));
  page.on("pageerror", (e) => found.problems.push("script: " + String(e).slice(0, 200)));
  page.on("request", (r) => !r.url().startsWith(origin) && !/^(data|blob|about):/.test(r.url()) && found.outside.push(r.url()));
  await page.setViewport({ width: 1280, height: 900 });
  await page.goto(url, { waitUntil: "networkidle2"});
  if (page.url().includes("token")) found.problems.push("the secret stays in the address");
  await see(page, "no shot.toml");
  await film(page, "A folder with the files of a test: scope, image correlation, workbook");
  found.hostile = await hostile(browser, origin);
  await page.bringToFront();
  await page.goto(`${origin}/setup?shot=shot5`, { waitUntil: "networkidle2" });
  await film(page, "Set up: the page looks at the files");
  await press(page, "Look at the files and write shot.toml");
  await see(page, "11 values are not filled in");
  await pause(1500);
  await film(page, "What the files show is filled in; what they do not show is left blank");
  await looked(page, "setup-begin", [1280]);
  for (const [i, [key, words]] of typed.entries()) {
    await fill(page, key, words);
    if (i % 3 === 2) await film(page, "Type what no file holds: sizes, density, sensitivity, contact", 0.7);
  }
  await see(page, "Every value is filled in", 90);
  const plot = await to(page, '[aria-label="The force\'s signal"]');
  const box = await plot.boundingBox();
  await page.mouse.move(box.x + 80, box.y + 120);
  await page.mouse.down();
  for (const dx of [90, 100, 110]) { await page.mouse.move(box.x + dx, box.y + 122); await pause(60); }
  await film(page, "Drag over the signal: the baseline before the impact");
  await page.mouse.up();
  await pause(1500);
  found.baseline = (await page.$$eval("textarea", (all) => all[0].value)).match(/^baseline = (\[.*?\])/m)[1];
  await film(page, "The text of shot.toml changes with it");
  await press(page, "Undo");
  await pause(1200);
  await twoTabs(browser, page, `${origin}/setup?shot=shot5`);
  found.states.undone = [await declared(page, "length"), await declared(page, "density")];
  await press(page, "Check");
  await see(page, "The check passed", 120);
  await page.waitForFunction(() => !document.querySelector(".q-notification"), { timeout: 30000 }); // of the two tabs
  await page.evaluate(() => scrollTo(0, 0));
  await film(page, "Check reads every file");
  await looked(page, "setup");
  await page.goto(`${origin}/run?shot=shot5`, { waitUntil: "networkidle2" });
  await page.type('[aria-label="Options, as on the command line"]', process.env.OPTIONS);
  await press(page, "Start");
  await see(page, "running: .*, \\d+ of \\d+", 120);
  await film(page, "Identify: progress, log, cancel");
  await looked(page, "run");
  await page.goto("about:blank"); // a closed tab ends nothing
  gone = true;
  second = await killed(page); // nor does the end of the server
  gone = false;
  await page.goto(`${origin}/run?shot=shot5`, { waitUntil: "networkidle2" });
  found.states.afterKill = await page.$eval("body", (one) => one.innerText.match(/kolsky identify, started .*/)[0]);
  await see(page, "finished", 1500);
  found.log = await page.$eval('[role="log"]', (one) => one.innerText);
  await film(page, "Finished: the answer with its uncertainty", 2.5);
  await page.goto(`${origin}/look?shot=shot5`, { waitUntil: "networkidle2" });
  const now = await page.waitForSelector('[aria-label="Time"]');
  const time = await now.evaluateHandle((one) => one.closest(".q-slider"));
  await pause(1500);
  const row = await time.boundingBox();
  for (const share of [0.15, 0.3, 0.45, 0.6, 0.75, 0.9]) {
    await page.mouse.click(row.x + share * row.width, row.y + 0.5 * row.height);
    await pause(700);
    await film(page, "Look: force, residual, outline and specimen at one time", 0.6);
  }
  await page.mouse.click(row.x + row.width - 1, row.y + 0.5 * row.height);
  const slider = await to(page, '[aria-label^="stiffness factor"]');
  const track = await slider.evaluateHandle((one) => one.closest(".q-slider"));
  const place = await track.boundingBox();
  await page.mouse.click(place.x + 0.62 * place.width, place.y + 0.5 * place.height);
  await see(page, ", at the answer", 60);
  await film(page, "What if: another stiffness is simulated", 2.5);
  await page.evaluate(() => scrollTo(0, 0));
  await pause(800);
  await film(page, "In blue: what the force would have been", 2.5);
  await looked(page, "look");
  const report = await tab(browser);
  const whole = await report.goto(`${origin}/result?shot=shot5&name=report.html`);
  found.states.report = [whole.status(), await report.title()];
  await report.close();
  await page.bringToFront();
  const copy = path.join(root, "shot5, longer");
  fs.cpSync(path.join(root, "shot5"), copy, { recursive: true, filter: (one) => !one.endsWith("results") });
  await page.goto(`${origin}/setup?shot=${encodeURIComponent("shot5, longer")}`, { waitUntil: "networkidle2" });
  await fill(page, "specimen.length", "6.6 mm");
  await page.goto(`${origin}/run?shot=${encodeURIComponent("shot5, longer")}`, { waitUntil: "networkidle2" });
  await page.type('[aria-label="Options, as on the command line"]', process.env.COARSER);
  await press(page, "Start");
  await see(page, "finished", 1500);
  await page.goto(`${origin}/compare?shots=${encodeURIComponent("shot5|shot5, longer")}`, { waitUntil: "networkidle2" });
  await see(page, "longer: m =|There is no rate study", 90);
  await pause(800);
  await film(page, "Compare: a copy with another length of the specimen", 2.5);
  await looked(page, "compare");
  await page.goto(`${origin}/run?shot=shot5`, { waitUntil: "networkidle2" });
  await choose(page, "Command", "Sweep: many simulations over the free parameters");
  await press(page, "Start");
  await see(page, "kolsky sweep, .*: finished", 240);
  await page.type('[aria-label="Options, as on the command line"]', "--design sobol --runs 131072 --ledger none --vary damping=0:100us");
  await press(page, "Start");
  await see(page, "kolsky sweep, .*: running: sweep, \\d+ of 131072", 120);
  await press(page, "Cancel");
  await see(page, "kolsky sweep, .*: cancelled", 240);
  await page.goto(`${origin}/pictures?shot=plane`, { waitUntil: "networkidle2" });
  await page.waitForSelector("img[alt='Picture of camera 0']");
  await looked(page, "pictures");
  await page.goto(`${origin}/run?shot=plane`, { waitUntil: "networkidle2" });
  await press(page, "Start");
  await see(page, "kolsky dic, .*: finished", 240);
  await page.goto(`${origin}/pictures?shot=plane`, { waitUntil: "networkidle2" });
  await choose(page, "Colour of the pictures", "strain Exx (%)");
  await choose(page, "A click on a picture", "follows the point there through time");
  const frames = await (await page.waitForSelector('[aria-label="Frame"]')).evaluateHandle((one) => one.closest(".q-slider"));
  const bar = await frames.boundingBox();
  await page.mouse.click(bar.x + bar.width - 1, bar.y + 0.5 * bar.height);
  await pause(800);
  const seen = await (await page.waitForSelector("img[alt='Picture of camera 0']")).boundingBox();
  await page.mouse.click(seen.x + 0.75 * seen.width, seen.y + 0.5 * seen.height);
  await see(page, "in frame 2", 60);
  found.states.point = await page.$eval("body", (one) => one.innerText.match(/Exx = .* in frame 2/)[0]);
  await pause(800);
  await looked(page, "fields");
  await page.goto(`${origin}/`, { waitUntil: "networkidle2" });
  await see(page, "pictures only");
  await looked(page, "shots");
  await page.type('[aria-label^="Filter"]', "longer");
  await pause(1200);
  found.states.filtered = await page.$$eval("tbody a", (all) => all.map((one) => one.innerText));
  await browser.close();
  second.kill();
  console.log(JSON.stringify(found));
  process.exit(0);
})().catch((error) => { second?.kill(); console.log(JSON.stringify({ ...found, problems: [...found.problems, String(error)] })); process.exit(1); });
