// Renders jobs in an engine's page, in Chromium without a window: `node drive.mjs ENGINE FOLDER JOBS.json`.
//
// Pictures go into the folder as they are: NAME.f32, rows from below, four 32-bit floats a pixel.
import { createReadStream, existsSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { basename, dirname, extname, join, normalize, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

const [engine, folder, jobsFile] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const types = {
  '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.wasm': 'application/wasm',
  '.glb': 'model/gltf-binary', '.json': 'application/json',
};

// Pages and their packages lie beside this file; what begins with /out/ is the folder of the jobs.
function place(url) {
  const path = normalize(decodeURIComponent(url.pathname));
  if (path.startsWith('/out/')) return join(resolve(folder), path.slice(5));
  return path.startsWith('/integrations/') ? join(here, '../..', path) : join(here, path);
}

const server = createServer((request, answer) => {
  const url = new URL(request.url, 'http://localhost');
  if (request.method === 'POST') {
    const parts = [];
    request.on('data', (part) => parts.push(part));
    request.on('end', () => {
      writeFileSync(join(folder, basename(url.searchParams.get('name'))), Buffer.concat(parts));
      answer.end();
    });
    return;
  }
  const file = place(url);
  if (!existsSync(file) || statSync(file).isDirectory()) {
    answer.statusCode = 404;
    answer.end();
    return;
  }
  answer.setHeader('content-type', types[extname(file)] ?? 'application/octet-stream');
  createReadStream(file).pipe(answer);
});
await new Promise((ready) => server.listen(0, '127.0.0.1', ready));

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? ['/usr/bin/chromium', '/usr/bin/chromium-browser',
    '/usr/bin/google-chrome'].find(existsSync),
  args: ['--headless', '--no-sandbox', '--enable-unsafe-swiftshader', '--disable-background-networking'],
});
const page = await browser.newPage({ viewport: { width: 800, height: 600 } });
page.setDefaultTimeout(540000);
const noise = /^\s*$|GPU stall|GroupMarkerNotSet|BJS - |FEngine|WebKit|eature level|404/;
page.on('console', (message) => {
  if (!noise.test(message.text())) console.error(`${engine}: ${message.text().slice(0, 400)}`);
});
page.on('pageerror', (error) => console.error(`${engine}: ${String(error).slice(0, 600)}`));
await page.goto(`http://127.0.0.1:${server.address().port}/${engine}.html`);
await page.waitForFunction('window.ready === true', null, { timeout: 60000 });
let failed = 0;
for (const job of JSON.parse(readFileSync(jobsFile))) {
  const began = Date.now();
  try {
    const told = await page.evaluate((job) => window.run(job), job);
    console.log(JSON.stringify({ name: job.name, ms: Date.now() - began, ...told }));
  } catch (error) {
    failed += 1;
    console.error(`${engine}: ${job.name} failed: ${String(error).slice(0, 500)}`);
  }
}
await browser.close();
server.close();
process.exit(failed ? 1 : 0);
