import { CompressedArrayTexture, Loader, MeshStandardMaterial, Vector2, Vector4 } from 'three';

/** Map of lobes: a texture whose layers are lobes, and how to read it. */
export class NdfMap {
  constructor(texture: CompressedArrayTexture, header: object);
  readonly texture: CompressedArrayTexture;
  /** JSON of the file's key `ndfmap`. */
  readonly header: object;
  /** Number of lobes. */
  readonly lobes: number;
  /** Values of 0, and spans to the greatest integer, for each layer; 0 and 1 for floats. */
  readonly low: Vector4[];
  readonly span: Vector4[];
  /** Level of the normal map that the map's finest is. */
  readonly fromLevel: number;
  /** Size of the normal map, in texels. */
  readonly size: Vector2;
  dispose(): void;
}

/** Loader of maps in KTX2, by `ndfmap bake --method vmf:J`, in half floats or `--precision unorm8`. */
export class NdfLoader extends Loader<NdfMap> {
  /** Reads a file; rejects with a reason for one that is no such map, or damaged. */
  parse(buffer: ArrayBuffer, name?: string): Promise<NdfMap>;
}

/** Lets a standard or physical material be shaded by the lobes of the map that was baked from its normal map. */
export function applyNdf<M extends MeshStandardMaterial>(material: M, map: NdfMap): M;
