// What every engine shows: a plane to the horizon and a sphere, from the same eyes, under the same suns.
export const SIDE = 256;
export const stages = {
  plane: { fov: 45, eye: [0.3, 1.6, 0], target: [0.6, 0.35, -4], sun: [-2.5, 2.2, -1.5] },
  sphere: { fov: 24, eye: [0, 0.4, 7], target: [0, 0, 0], sun: [2, 2.5, 3] },
};

// Offsets of a pixel's samples: a jittered grid, the same each time.
export function jitter(side) {
  let seed = 1;
  const random = () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) / 4294967296;
  if (side < 2) return [[0, 0]];
  const offsets = [];
  for (let y = 0; y < side; y++) {
    for (let x = 0; x < side; x++) offsets.push([(x + random()) / side - 0.5, (y + random()) / side - 0.5]);
  }
  return offsets;
}

export const save = (name, floats) => fetch(`/save?name=${name}.f32`, { method: 'POST', body: floats.buffer });
