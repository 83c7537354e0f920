// Prints what an engine is to render: `node jobs.mjs ENGINE SIDE VARIANTS MAPS LIGHTS FILTERS`, each but the
// first two a list with commas; the truth takes SIDE × SIDE samples a pixel.
const [engine, side, ...lists] = process.argv.slice(2);
const [variants, maps, lights, filters] = lists.map((list) => list.split(','));
const jobs = [];
for (const map of maps) {
  for (const object of ['plane', 'sphere']) {
    for (const light of lights) {
      const scene = `${engine}_${map}_${object}_${light}`;
      // Lobes are laid on the stock model.
      const url = (variant) => `/out/${map}_${variant.startsWith('lobes') ? 'stock' : variant}.glb`;
      const lobes = (variant) => (variant.startsWith('lobes') ? `/out/${map}_${variant}.ktx2` : undefined);
      jobs.push({ name: `${scene}_truth`, url: url('stock'), object, light, truth: true, side: Number(side) });
      for (const anisotropy of filters.map(Number)) {
        for (const variant of variants) {
          jobs.push({ name: `${scene}_${anisotropy}x_${variant}`, url: url(variant), lobes: lobes(variant), object, light, anisotropy });
        }
      }
    }
  }
}
console.log(JSON.stringify(jobs));
