// Compares Khronos's validator on models before and after a change: `node validate.mjs BEFORE AFTER...` fails for
// an error that is new.
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import validator from 'gltf-validator';

const pairs = process.argv.slice(2);
let failed = false;
const errors = async (file) => {
  const externalResourceFunction = async (uri) =>
    new Uint8Array(readFileSync(join(dirname(file), decodeURIComponent(uri))));
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), { externalResourceFunction });
  return report.issues;
};
for (let i = 0; i + 1 < pairs.length; i += 2) {
  const [before, after] = [await errors(pairs[i]), await errors(pairs[i + 1])];
  const counts = (issues) => `${issues.numErrors} errors, ${issues.numWarnings} warnings`;
  console.log(`${pairs[i + 1]}: ${counts(after)}; before ${counts(before)}`);
  const codes = new Set(after.messages.filter((m) => m.severity < 2).map((m) => m.code));
  console.log(`  ${[...codes].join(', ') || 'nothing to say'}`);
  failed ||= after.numErrors > before.numErrors;
}
process.exit(failed ? 1 : 0);
