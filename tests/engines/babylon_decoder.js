// Babylon's own KTX2 decoder is not on npm. This one has its interface and hands Basis files to Binomial's
// transcoder, which three.js brings along.
const transcoder = (() => {
  const folder = '/node_modules/three/examples/jsm/libs/basis/';
  let ready;
  return () => (ready ??= (async () => {
    const wasmBinary = await (await fetch(`${folder}basis_transcoder.wasm`)).arrayBuffer();
    const module = await window.BASIS({ wasmBinary });
    module.initializeBasis();
    return module;
  })());
})();

class Decoder {
  async decode(bytes, caps) {
    const module = await transcoder();
    const file = new module.KTX2File(bytes);
    if (!file.isValid() || !file.startTranscoding()) throw new Error('no sound Basis file');
    const BC7 = 6;
    const RGBA = 13;
    const target = caps.bptc ? BC7 : RGBA;
    const mipmaps = [];
    for (let level = 0; level < file.getLevels(); level++) {
      const data = new Uint8Array(file.getImageTranscodedSizeInBytes(level, 0, 0, target));
      if (!file.transcodeImage(data, level, 0, 0, target, 0, -1, -1)) throw new Error('not transcoded');
      mipmaps.push({ data, width: Math.max(file.getWidth() >> level, 1), height: Math.max(file.getHeight() >> level, 1) });
    }
    const size = { width: file.getWidth(), height: file.getHeight() };
    file.close();
    file.delete();
    // Names of OpenGL: COMPRESSED_RGBA_BPTC_UNORM, RGBA8.
    return { ...size, transcodedFormat: caps.bptc ? 0x8e8c : 0x8058, mipmaps, isInGammaSpace: false, hasAlpha: false,
      transcoderName: 'basis' };
  }
}

const none = () => class {};
window.KTX2DECODER = {
  Transcoder: none(), LiteTranscoder_UASTC_ASTC: none(), LiteTranscoder_UASTC_BC7: none(),
  LiteTranscoder_UASTC_RGBA_UNORM: none(), LiteTranscoder_UASTC_RGBA_SRGB: none(),
  LiteTranscoder_UASTC_R8_UNORM: none(), LiteTranscoder_UASTC_RG8_UNORM: none(), MSCTranscoder: none(),
  ZSTDDecoder: none(), WASMMemoryManager: none(), KTX2Decoder: Decoder,
};
