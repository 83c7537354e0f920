// Normal distribution maps in three.js: lobes of normals that a texel of a normal map's mips stands for, each
// shaded by three.js's own material. Maps are what `ndfmap bake --method vmf:J` writes.
//
//   const map = await new NdfLoader().loadAsync('leather.ndf.ktx2');
//   applyNdf(mesh.material, map);
//
// Lights, shadows, environments, clear coats and tone mapping are three.js's own. The material keeps its
// normal map: near by it is what is seen, and the lobes take over as it shrinks.

import {
  ClampToEdgeWrapping, CompressedArrayTexture, FileLoader, HalfFloatType, LinearFilter, LinearMipmapLinearFilter,
  Loader, NoColorSpace, RGBAFormat, RepeatWrapping, TangentSpaceNormalMap, UnsignedByteType,
  Vector2, Vector4,
} from 'three';
import { read } from 'three/addons/libs/ktx-parse.module.js';
import { ZSTDDecoder } from 'three/addons/libs/zstddec.module.js';

// Vulkan's formats of maps (RGBA8 unorm, RGBA16 floats), and the names that three.js has for them.
const BYTES = 37;
const HALVES = 97;
const FORMATS = {
  [BYTES]: { type: UnsignedByteType, array: Uint8Array },
  [HALVES]: { type: HalfFloatType, array: Uint16Array },
};
const ZSTANDARD = 2;

/** Map of lobes: a texture whose layers are lobes, and how to read it. */
export class NdfMap {
  /**
   * @param {CompressedArrayTexture} texture Layers of sums of lobes, with their own levels.
   * @param {object} header JSON of the file's key `ndfmap`.
   */
  constructor(texture, header) {
    this.texture = texture;
    this.header = header;
    this.lobes = texture.image.depth;
    const ranges = header.compact?.ranges ?? new Array(4 * this.lobes).fill([0, 1]);
    const four = (layer, of) => new Vector4(...ranges.slice(4 * layer, 4 * layer + 4).map(of));
    const layers = [...Array(this.lobes).keys()];
    this.low = layers.map((layer) => four(layer, ([low]) => low));
    this.span = layers.map((layer) => four(layer, ([low, high]) => high - low));
    this.fromLevel = header.from_level ?? 0;
    // Of level 0, which a map may leave out.
    this.size = new Vector2(texture.image.width, texture.image.height).multiplyScalar(2 ** this.fromLevel);
  }

  dispose() {
    this.texture.dispose();
  }
}

/** Loader of maps in KTX2. */
export class NdfLoader extends Loader {
  load(url, onLoad, onProgress, onError) {
    const loader = new FileLoader(this.manager);
    loader.setPath(this.path);
    loader.setCrossOrigin(this.crossOrigin);
    loader.setWithCredentials(this.withCredentials);
    loader.setRequestHeader(this.requestHeader);
    loader.setResponseType('arraybuffer');
    const failed = (error) => {
      if (onError) onError(error);
      else console.error(error);
      this.manager.itemError(url);
    };
    loader.load(url, (buffer) => this.parse(buffer, url).then(onLoad).catch(failed), onProgress, onError);
  }

  /**
   * Reads a file.
   * @param {ArrayBuffer} buffer Bytes of the file.
   * @param {string} [name] Name for errors.
   * @returns {Promise<NdfMap>}
   */
  async parse(buffer, name = 'map') {
    const fail = (reason) => { throw new Error(`${name}: ${reason}`); };
    let file;
    try {
      file = read(new Uint8Array(buffer));
    } catch (error) {
      fail(`is no sound KTX2 (${error.message})`);
    }
    const text = file.keyValue?.ndfmap;
    if (text === undefined) fail('is a KTX2 of another kind: it lacks the key `ndfmap` of a baked map');
    let header;
    try {
      header = JSON.parse(typeof text === 'string' ? text.replace(/\0+$/, '') : new TextDecoder().decode(text).replace(/\0+$/, ''));
    } catch {
      fail('has a key `ndfmap` that cannot be read');
    }
    if (!(header?.version <= 2)) fail(`has header version ${header?.version}; this loader reads up to 2`);
    const lobes = /^vmf:([1-8])/.exec(header.method ?? '');
    if (!lobes || header.encoding !== 'sums-about-pole') {
      fail(`was baked by \`${header.method}\`; lobes of \`vmf:1\` to \`vmf:8\` are read`);
    }
    const depth = Number(lobes[1]);
    const compact = header.compact;
    const format = FORMATS[file.vkFormat];
    if (file.vkFormat !== (compact ? BYTES : HALVES) || (compact && compact.bits !== 8)) {
      fail('has texels of a kind that WebGL does not filter: bake it with --precision unorm8 or half');
    }
    const isRange = (range) => Array.isArray(range) && range.length === 2 && range.every(Number.isFinite) && range[0] <= range[1];
    if (compact && !(compact.ranges?.length >= 4 * depth && compact.ranges.every(isRange))) {
      fail('has no sound range for each channel');
    }
    if (header.wrap?.length !== 2) fail('does not say how it wraps');
    if (file.layerCount < depth) fail(`has ${file.layerCount} layers, where \`${header.method}\` has ${depth}`);
    const compressed = file.supercompressionScheme === ZSTANDARD;
    if (file.supercompressionScheme && !compressed) fail('is compressed in a way that is not read');
    const decoder = new ZSTDDecoder();
    if (compressed) await decoder.init();
    const texel = 4 * format.array.BYTES_PER_ELEMENT;
    const mipmaps = file.levels.map(({ levelData, uncompressedByteLength }, level) => {
      const [width, height] = [file.pixelWidth, file.pixelHeight].map((side) => Math.max(1, side >> level));
      const layer = width * height * texel;
      let bytes;
      try {
        bytes = compressed ? decoder.decode(levelData, uncompressedByteLength) : levelData;
      } catch (error) {
        fail(`has a damaged level ${level} (${error.message})`);
      }
      if (bytes.byteLength !== layer * file.layerCount) {
        fail(`has ${bytes.byteLength} bytes in level ${level}, where ${layer * file.layerCount} are due`);
      }
      // Lobes come first, attributes behind them.
      const data = new format.array(bytes.slice(0, layer * depth).buffer);
      return { data, width, height };
    });
    const texture = new CompressedArrayTexture(
      mipmaps, file.pixelWidth, file.pixelHeight, depth, RGBAFormat, format.type);
    const wrap = (word) => (word === 'clamp' ? ClampToEdgeWrapping : RepeatWrapping);
    [texture.wrapS, texture.wrapT] = header.wrap.map(wrap);
    texture.minFilter = LinearMipmapLinearFilter;
    texture.magFilter = LinearFilter;
    texture.colorSpace = NoColorSpace;
    texture.needsUpdate = true;
    return new NdfMap(texture, header);
  }
}

// Lobes of a texel, in view space; the last is the normal map's own.
const DECLARATIONS = /* glsl */`
#define NDF_ALL ( NDF_LOBES + 1 )
uniform highp sampler2DArray ndfMap;
uniform vec4 ndfLow[ NDF_LOBES ];
uniform vec4 ndfSpan[ NDF_LOBES ];
uniform vec2 ndfSize;
uniform float ndfAnisotropy;
uniform float ndfFromLevel;
uniform float ndfFlip;
vec3 ndfNormal[ NDF_ALL ];
float ndfWeight[ NDF_ALL ];
float ndfVariance[ NDF_ALL ];

// Share of the map against the normal map: a texture unit's level of detail, beyond the level that both have.
float ndfShare( const in vec2 dx, const in vec2 dy ) {
	float longer = max( length( dx ), length( dy ) );
	float shorter = max( min( length( dx ), length( dy ) ), 1e-6 );
	float taps = clamp( ceil( longer / shorter ), 1.0, ndfAnisotropy );
	return ndfFromLevel > 0.0 ? saturate( log2( max( longer / taps, 1e-6 ) ) / ndfFromLevel ) : 1.0;
}

void ndfDecode( const in vec2 uv, const in mat3 frame, const in vec2 scale, const in vec3 near ) {
	vec2 at = vec2( uv.x, ndfFlip > 0.5 ? 1.0 - uv.y : uv.y );
	float share = ndfShare( dFdx( at ) * ndfSize, dFdy( at ) * ndfSize );
	float total = 0.0;
	for ( int j = 0; j < NDF_LOBES; j ++ ) {
		vec4 sums = ndfLow[ j ] + ndfSpan[ j ] * texture( ndfMap, vec3( at, float( j ) ) );
		float alpha = max( sums.x, 0.0 );
		vec3 r = sums.yzw / max( alpha, 1e-6 );
		// Half a step of eight bits says nothing.
		ndfWeight[ j ] = alpha > 2e-3 ? alpha : 0.0;
		float spread = clamp( 2.0 * r.z - r.z * r.z - dot( r.xy, r.xy ), 0.0, 1.0 );
		float size = max( sqrt( 1.0 - spread ), 1e-3 );
		ndfVariance[ j ] = spread / ( size * ( 3.0 - size * size ) );
		ndfNormal[ j ] = normalize( frame * vec3( r.xy * scale, max( 1.0 - r.z, 1e-3 ) ) );
		total += ndfWeight[ j ];
	}
	for ( int j = 0; j < NDF_LOBES; j ++ ) ndfWeight[ j ] *= share / max( total, 1e-6 );
	ndfNormal[ NDF_LOBES ] = near;
	ndfWeight[ NDF_LOBES ] = 1.0 - share;
	ndfVariance[ NDF_LOBES ] = 0.0;
}
`;

// The engine's own shading, twice a lobe.
const SHADING = /* glsl */`
// A GGX blurred by a Gaussian of normals keeps the tail of the GGX: far off, it is this share of a GGX as wide
// as both. The rest is a Gaussian.
float ndfTail( const in float alpha, const in float variance ) {
	return alpha * alpha / ( alpha * alpha + 2.0 * variance );
}

float ndfCore( const in float width, const in float u ) {
	float u2 = max( u * u, 1e-4 );
	return exp( ( 1.0 - 1.0 / u2 ) / ( width * width ) ) / ( PI * width * width * u2 * u2 );
}

// The engine's mirrored light by a facet, for each unit of the facets' density.
vec3 ndfByFacet( const in vec3 facet, const in vec3 halfDir, const in float alpha, const in IncidentLight directLight, const in vec3 viewDir, const in PhysicalMaterial material ) {
	return saturate( dot( facet, directLight.direction ) ) * directLight.color
		* BRDF_GGX( directLight.direction, viewDir, facet, material ) * material.multiScatteringCompensation
		/ max( D_GGX( alpha, saturate( dot( facet, halfDir ) ) ), 1e-6 );
}

// In the core the facet that shines lies between the lobe's mean and the half vector, as the widths of the lobe
// and of the material say: the mean of the product of two Gaussians. In the tail every normal of the lobe shines
// alike, and the facet is the lobe's own. Cosines and masking are the facet's, and the engine works them out.
// Diffuse light, coats and sheen go by the normal map.
void RE_Direct_Ndf( const in IncidentLight directLight, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight ) {
	vec3 specular = reflectedLight.directSpecular;
	RE_Direct_Physical( directLight, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
	reflectedLight.directSpecular = specular;
	vec3 halfDir = normalize( directLight.direction + geometryViewDir );
	float alpha = pow2( material.roughness );
	for ( int j = 0; j < NDF_ALL; j ++ ) {
		if ( ndfWeight[ j ] <= 0.0 ) continue;
		float width = sqrt( alpha * alpha + 2.0 * ndfVariance[ j ] );
		float u = saturate( dot( ndfNormal[ j ], halfDir ) );
		float tail = ndfTail( alpha, ndfVariance[ j ] );
		vec3 shines = tail * D_GGX( width, u ) * ndfByFacet( ndfNormal[ j ], halfDir, alpha, directLight, geometryViewDir, material );
		if ( tail < 1.0 ) {
			vec3 facet = normalize( 0.5 * alpha * alpha * ndfNormal[ j ] + ndfVariance[ j ] * halfDir );
			shines += ( 1.0 - tail ) * ndfCore( width, u ) * ndfByFacet( facet, halfDir, alpha, directLight, geometryViewDir, material );
		}
		reflectedLight.directSpecular += ndfWeight[ j ] * shines;
	}
}

#ifdef USE_ENVMAP
// A lobe's normals spread mirrored light twice as far as they lie apart in the plane of incidence, and less across
// it, by the cosine to the eye. Direction and share are the material's own.
vec3 ndfRadiance( const in vec3 viewDir, const in int j, const in float roughness ) {
#ifdef ENVMAP_TYPE_PMREM
	vec3 normal = ndfNormal[ j ];
	float cosine = saturate( dot( normal, viewDir ) );
	float alpha = pow2( roughness );
	float width = sqrt( alpha * alpha + ( 1.0 + cosine * cosine ) * ndfVariance[ j ] );
	vec3 towards = normalize( mix( reflect( - viewDir, normal ), normal, pow4( roughness ) ) );
	towards = transformDirectionByInverseViewMatrix( towards, viewMatrix );
	return textureLod( envMap, envMapRotation * towards, roughnessToMip( min( sqrt( width ), 1.0 ) ) ).rgb * envMapIntensity;
#else
	return vec3( 0.0 );
#endif
}

void RE_IndirectSpecular_Ndf( const in vec3 radiance, const in vec3 irradiance, const in vec3 clearcoatRadiance, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight ) {
	for ( int j = 0; j < NDF_ALL; j ++ ) {
		float weight = ndfWeight[ j ];
		if ( weight <= 0.0 ) continue;
		PhysicalMaterial own = material;
		own.dfg = texture2D( dfgLUT, vec2( material.roughness, saturate( dot( ndfNormal[ j ], geometryViewDir ) ) ) ).rg;
		vec3 seen = ndfRadiance( geometryViewDir, j, material.roughness );
		RE_IndirectSpecular_Physical( weight * seen, weight * irradiance, weight * clearcoatRadiance, geometryPosition, ndfNormal[ j ], geometryViewDir, geometryClearcoatNormal, own, reflectedLight );
	}
}
#undef RE_IndirectSpecular
#define RE_IndirectSpecular RE_IndirectSpecular_Ndf
#endif

#undef RE_Direct
#define RE_Direct RE_Direct_Ndf
`;

const DECODING = /* glsl */`
#include <normal_fragment_maps>
ndfDecode( vNormalMapUv, tbn, normalScale, normal );
`;

// Materials that maps were applied to.
const APPLIED = new WeakMap();

/**
 * Lets a material be shaded by a map's lobes. Once more, it takes the new map.
 *
 * @param {MeshStandardMaterial} material Standard or physical, with the normal map that the map was baked from.
 * @param {NdfMap} map Its map.
 * @returns {MeshStandardMaterial} The material.
 */
export function applyNdf(material, map) {
  const refuse = (reason) => { throw new Error(`applyNdf: the material ${reason}`); };
  if (!material.isMeshStandardMaterial) refuse('is not standard or physical');
  if (!material.normalMap) refuse('has no normal map, whose place a map takes');
  if (material.normalMapType !== TangentSpaceNormalMap) refuse('has normals in object space');
  for (const key of ['anisotropy', 'sheen', 'retroreflectivity']) {
    if (material[key] > 0) refuse(`has ${key}, which lobes do not have`);
  }
  map.texture.anisotropy = material.normalMap.anisotropy;
  const uniforms = {
    ndfMap: { value: map.texture },
    ndfLow: { value: map.low },
    ndfSpan: { value: map.span },
    ndfSize: { value: map.size },
    ndfAnisotropy: { value: map.texture.anisotropy },
    ndfFromLevel: { value: map.fromLevel },
    // Rows of a map run down, as those of glTF's textures do.
    ndfFlip: { value: material.normalMap.flipY ? 1 : 0 },
  };
  const applied = APPLIED.get(material);
  if (applied) {
    // Another map, or the same once more: the shader is there.
    Object.keys(uniforms).forEach((name) => { applied.uniforms[name].value = uniforms[name].value; });
    if (applied.lobes !== map.lobes) material.needsUpdate = true;
    applied.lobes = map.lobes;
    return material;
  }
  const own = { uniforms, lobes: map.lobes };
  APPLIED.set(material, own);
  const before = material.onBeforeCompile;
  // The engine's own key tells hooks apart by their text, which is now ours.
  const key = material.customProgramCacheKey();
  material.onBeforeCompile = (shader, renderer) => {
    before.call(material, shader, renderer);
    Object.assign(shader.uniforms, own.uniforms);
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <lights_physical_pars_fragment>',
        `#define NDF_LOBES ${own.lobes}\n${DECLARATIONS}\n#include <lights_physical_pars_fragment>\n${SHADING}`)
      .replace('#include <normal_fragment_maps>', DECODING);
  };
  material.customProgramCacheKey = () => `${key}|ndf${own.lobes}`;
  material.needsUpdate = true;
  return material;
}
