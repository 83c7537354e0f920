// UASTC by Binomial's encoder: `node encoders.mjs FOLDER` packs every NAME.rgba of the folder at three levels of effort,
// into NAME.binomial-LEVEL.ktx2, and writes the seconds beside it.
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { encodeToKTX2 } from 'ktx2-encoder';

const folder = process.argv[2];
for (const file of readdirSync(folder).filter((name) => name.endsWith('.rgba'))) {
  const name = file.slice(0, -5);
  const { width, height } = JSON.parse(readFileSync(join(folder, `${name}.json`)));
  const data = new Uint8Array(readFileSync(join(folder, file)));
  const encode = (level) => encodeToKTX2(data, {
    isUASTC: true, uastcLDRQualityLevel: level, generateMipmap: false, needSupercompression: false,
    isSetKTX2SRGBTransferFunc: false, isPerceptual: false,
    imageDecoder: async (buffer) => ({ data: new Uint8Array(buffer), width, height }),
  });
  await encode(0);
  for (const level of [0, 1, 2]) {
    const start = performance.now();
    const ktx2 = await encode(level);
    const seconds = (performance.now() - start) / 1000;
    writeFileSync(join(folder, `${name}.binomial-${level}.ktx2`), ktx2);
    writeFileSync(join(folder, `${name}.binomial-${level}.json`), JSON.stringify({ seconds }));
  }
}
