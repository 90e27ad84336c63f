// node audit.js OUT PAGE...: pictures at 390 and 1280 px and on A4, light and dark; axe-core, html-validate,
// width, errors of the console. The folder of node_modules is in NODE_PATH. Exit 1 if anything is found.
const fs = require("fs");
const path = require("path");
const puppeteer = require("puppeteer-core");
const { HtmlValidate } = require("html-validate");

const axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const browserPath = process.env.CHROMIUM || "/usr/bin/chromium";
const validators = {
  ours: new HtmlValidate({ extends: ["html-validate:recommended"] }),
  // Of the documentation its generator chooses how tags are written, and the theme <article role="main">.
  documentation: new HtmlValidate({
    extends: ["html-validate:standard", "html-validate:a11y"], rules: { "prefer-native-element": "off" },
  }),
};

async function looked(page, file, out, scheme, width) {
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.setViewport({ width, height: width < 600 ? 844 : 1200 });
  await page.goto("file://" + path.resolve(file), { waitUntil: "load", timeout: 120000 });
  const found = [];
  const stem = path.join(out, path.basename(file, ".html"));
  await page.screenshot({ path: `${stem}-${width}-${scheme}-first.png` });
  await page.evaluate(() => document.querySelectorAll("details").forEach((fold) => { fold.open = true; }));
  const beyond = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  if (beyond > 0) found.push(`${beyond} px wider than the screen`);
  if (scheme === "light" || width > 1000) {
    await page.screenshot({ path: `${stem}-${width}-${scheme}.png`, fullPage: true });
  }
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => axe.run(document));
  for (const one of violations) found.push(`axe ${one.id} x${one.nodes.length}: ${one.nodes[0].html.slice(0, 160)}`);
  return found.map((text) => `${scheme} ${width}: ${text}`);
}

async function audited(browser, file, out) {
  const page = await browser.newPage();
  const found = [];
  page.on("console", (message) => message.type() === "error" && found.push("console: " + message.text()));
  page.on("pageerror", (error) => found.push("script: " + error));
  await page.setBypassCSP(true); // axe is a script that the pages' own policy refuses
  for (const scheme of ["light", "dark"]) {
    for (const width of [390, 1280]) found.push(...(await looked(page, file, out, scheme, width)));
  }
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "light" }]);
  await page.goto("file://" + path.resolve(file)); // folded, as it is printed
  await page.pdf({ path: path.join(out, path.basename(file, ".html") + ".pdf"), format: "A4", timeout: 120000 });
  const kind = fs.readFileSync(file, "utf8").includes("furo-main-content") ? "documentation" : "ours";
  const report = await validators[kind].validateFile(file);
  for (const result of report.results) {
    for (const message of result.messages) found.push(`html-validate ${message.ruleId} line ${message.line}: ${message.message}`);
  }
  await page.close();
  return found;
}

(async () => {
  const [out, ...files] = process.argv.slice(2);
  const args = ["--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"];
  let total = 0;
  for (const file of files) {
    const browser = await puppeteer.launch({ executablePath: browserPath, args, headless: true });
    const found = await audited(browser, file, out).catch((error) => ["not audited: " + error]);
    await browser.close();
    total += found.length;
    console.log(`${path.basename(file)}: ${found.length ? "" : "clean"}`);
    for (const text of [...new Set(found)].slice(0, 12)) console.log("  " + text);
  }
  process.exit(total ? 1 : 0);
})();
