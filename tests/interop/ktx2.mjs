// Reads a KTX2 file with an independent parser (npm ktx-parse) and prints what it saw as JSON.
// Usage: node ktx2.mjs FILE
import { readFileSync } from 'node:fs';
import { read, VK_FORMAT_R16G16B16A16_SFLOAT, VK_FORMAT_R32G32B32A32_SFLOAT } from 'ktx-parse';

const file = read(new Uint8Array(readFileSync(process.argv[2])));
const names = { [VK_FORMAT_R16G16B16A16_SFLOAT]: 'RGBA16F', [VK_FORMAT_R32G32B32A32_SFLOAT]: 'RGBA32F' };
const text = (value) => (typeof value === 'string' ? value : new TextDecoder().decode(value)).replace(/\0$/, '');
const last = file.levels[file.levels.length - 1].levelData;
const floats =
	file.vkFormat === VK_FORMAT_R32G32B32A32_SFLOAT
		? Array.from(new Float32Array(last.slice().buffer))
		: [];
console.log(
	JSON.stringify({
		format: names[file.vkFormat],
		typeSize: file.typeSize,
		width: file.pixelWidth,
		height: file.pixelHeight,
		layers: file.layerCount,
		faces: file.faceCount,
		supercompression: file.supercompressionScheme,
		levels: file.levels.map((level) => level.levelData.byteLength),
		samples: file.dataFormatDescriptor[0].samples.length,
		keys: Object.keys(file.keyValue),
		ndfmap: JSON.parse(text(file.keyValue.ndfmap)),
		coarsest: floats,
	}),
);
