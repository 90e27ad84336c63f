// node walk.js URL OUT ROOT: the pages of `kolsky open` as a person uses them: a shot from raw files to its answer,
// by mouse and keyboard; a picture of each view and axe-core at 1280 and 390 px. Prints one JSON object.
const fs = require("fs");
const path = require("path");
const puppeteer = require("puppeteer-core");
const axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const [url, out, root] = process.argv.slice(2);
const found = { problems: [], outside: [], baseline: "", log: "" };
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function see(page, words, seconds = 120) {
  const text = typeof words === "string" ? words : words.source;
  await page
    .waitForFunction((t) => new RegExp(t).test(document.body.innerText), { timeout: 1000 * seconds }, text)
    .catch(() => { throw new Error(`did not see: ${text}`); });
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

async function press(page, words) {
  await page.evaluate((t) => {
    const all = [...document.querySelectorAll("button")].filter((one) => one.innerText.trim().split("\n").pop() === t); // an icon is a word too
    all[0].click();
  }, words);
}

async function fill(page, key, value) {
  const selector = `[data-key="${key}"]`;
  const field = await page.waitForSelector(selector, { timeout: 20000 });
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

(async () => {
  const typed = JSON.parse(fs.readFileSync(path.join(out, "typed.json"), "utf8"));
  const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM || "/usr/bin/chromium", headless: true,
    args: ["--no-sandbox", "--disable-gpu"],
  });
  const page = await browser.newPage();
  const origin = new URL(url).origin;
  page.on("console", (m) => m.type() === "error" && found.problems.push("console: " + m.text().slice(0, 200)));
  page.on("pageerror", (e) => found.problems.push("script: " + String(e).slice(0, 200)));
  page.on("request", (r) => !r.url().startsWith(origin) && !/^(data|blob):/.test(r.url()) && found.outside.push(r.url()));
  await page.setViewport({ width: 1280, height: 900 });
  await page.goto(url, { waitUntil: "networkidle2", timeout: 60000 });
  if (page.url().includes("token")) found.problems.push("the secret stays in the address");
  await see(page, "no shot.toml");
  await page.goto(`${origin}/setup?shot=shot5`, { waitUntil: "networkidle2" });
  await press(page, "Look at the files and write shot.toml");
  await see(page, "11 values are not filled in");
  await looked(page, "setup-begin", [1280]);
  for (const [key, value] of typed) await fill(page, key, value);
  await see(page, "Every value is filled in", 30);
  const plot = await page.$('[aria-label="The force\'s signal"]');
  await plot.evaluate((one) => one.scrollIntoView({ block: "center" }));
  await pause(800);
  const box = await plot.boundingBox();
  await page.mouse.move(box.x + 80, box.y + 120);
  await page.mouse.down();
  for (const dx of [90, 100, 110]) { await page.mouse.move(box.x + dx, box.y + 122); await pause(60); }
  await page.mouse.up();
  await pause(1500);
  found.baseline = (await page.$$eval("textarea", (all) => all[0].value)).match(/^baseline = (\[.*?\])/m)[1];
  await press(page, "Undo");
  await pause(1200);
  await press(page, "Check");
  await see(page, "The check passed", 120);
  await page.evaluate(() => scrollTo(0, 0));
  await looked(page, "setup");
  await page.goto(`${origin}/run?shot=shot5`, { waitUntil: "networkidle2" });
  await page.type('[aria-label="Options, as on the command line"]', process.env.OPTIONS || "");
  await press(page, "Start");
  await see(page, "running: .*, \\d+ of \\d+", 120);
  await looked(page, "run");
  await page.goto("about:blank"); // a closed tab ends nothing
  await pause(1000);
  await page.goto(`${origin}/run?shot=shot5`, { waitUntil: "networkidle2" });
  await see(page, "finished", 420);
  found.log = await page.$eval('[role="log"]', (one) => one.innerText);
  await page.goto(`${origin}/look?shot=shot5`, { waitUntil: "networkidle2" });
  const slider = await page.waitForSelector('[aria-label^="stiffness factor"]', { timeout: 60000 });
  await slider.evaluate((one) => one.scrollIntoView({ block: "center" }));
  const track = await slider.evaluateHandle((one) => one.closest(".q-slider"));
  const place = await track.boundingBox();
  await page.mouse.click(place.x + 0.62 * place.width, place.y + 0.5 * place.height);
  await see(page, ", at the answer ", 60);
  await press(page, "Draw the valley");
  await page.waitForSelector('[aria-label^="Misfit over"]', { timeout: 90000 });
  await page.evaluate(() => scrollTo(0, 0));
  await looked(page, "look");
  fs.cpSync(path.join(root, "shot5"), path.join(root, "shot6"), { recursive: true });
  await page.goto(`${origin}/compare?shots=shot5|shot6`, { waitUntil: "networkidle2" });
  await see(page, "shot6: m =|There is no rate study", 90);
  await looked(page, "compare");
  await page.goto(`${origin}/pictures?shot=plane`, { waitUntil: "networkidle2" });
  await page.waitForSelector("img[alt='Picture of camera 0']", { timeout: 60000 });
  await looked(page, "pictures");
  await page.goto(`${origin}/`, { waitUntil: "networkidle2" });
  await looked(page, "shots");
  await browser.close();
  console.log(JSON.stringify(found));
})().catch((error) => { console.log(JSON.stringify({ ...found, problems: [...found.problems, String(error)] })); process.exit(1); });
