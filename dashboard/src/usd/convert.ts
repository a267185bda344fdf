// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts a stage of USD to one .glb file. Parts that glTF or this program has no place for are
// noted.

import {Assets} from './assets';
import type {ReadFile} from './assets';
import {environmentOf} from './dome';
import type {Environment} from './dome';
import {Glb} from './glb';
import type {GltfNode, JsonObject} from './glb';
import {isNumbers, UsdError} from './layer';
import type {Prim} from './layer';
import {Lights} from './lights';
import {Materials} from './materials';
import type {Material} from './materials';
import {decompose, IDENTITY, multiply, ofQuaternion, scaleOf, translationOf} from './matrix';
import type {Matrix, Quaternion, Trs} from './matrix';
import {firstCorners, partOf, primvar, readPolygons, subsets} from './mesh';
import type {Part, Polygons} from './mesh';
import {shapeOf} from './shapes';
import {Skeletons} from './skeletons';
import {Stage} from './stage';
import type {StagePrim} from './stage';
import {Textures} from './textures';
import {Transform} from './xform';

const DEPTH_MAX = 256;
const INSTANCES_MAX = 1_000_000;
const SILENT = new Set([
  '',
  'Xform',
  'Scope',
  'SkelRoot',
  'Material',
  'Shader',
  'NodeGraph',
  'GeomSubset',
  'SkelAnimation',
  'BlendShape',
  'Backdrop',
  'RenderSettings',
  'RenderProduct',
  'RenderVar',
  'GenerativeProcedural',
]);

export interface Converted {
  glb: Uint8Array;
  // One line each, without the file's name.
  notes: string[];
  environment?: Environment;
}

class Notes {
  private readonly kinds = new Map < string, {
    first: string;
    count: number
  }
  > ();

  readonly add = (kind: string, place: string) => {
    const known = this.kinds.get(kind);
    if (known)
      known.count++;
    else
      this.kinds.set(kind, {first: place, count: 1});
  };

  lines(): string[] {
    return [...this.kinds].map(
        ([kind, {first, count}]) =>
            `${kind} (${first}${count > 1 ? ` and ${count - 1} more` : ''})`);
  }
}

class Converter {
  private readonly glb = new Glb();
  private readonly notes = new Notes();
  private readonly stage: Stage;
  private readonly materials: Materials;
  private readonly lights: Lights;
  private readonly skeletons: Skeletons;
  private readonly root: number;
  private readonly meshes = new Map<string, number>();
  private readonly ids = new WeakMap<Prim, number>();
  private idCount = 0;
  private instances = 0;
  private environment: Environment|undefined;
  private readonly turn: Quaternion;

  private readonly assets: Assets;

  constructor(readFile: ReadFile, file: string) {
    const assets = new Assets(readFile);
    this.assets = assets;
    const note = this.notes.add;
    this.stage = new Stage(assets, file, note);
    const {meta} = this.stage;
    const unit = typeof meta['metersPerUnit'] === 'number' && meta['metersPerUnit'] > 0 ?
        meta['metersPerUnit'] :
        0.01;
    const start = Number(meta['startTimeCode'] ?? 0);
    const rate = Number(meta['timeCodesPerSecond'] ?? meta['framesPerSecond'] ?? 24) || 24;
    const seconds = (times: number[]) => times.map(time => Math.max(0, (time - start) / rate));
    this.seconds = seconds;
    this.materials = new Materials(this.glb, new Textures(this.glb, assets, note), note);
    this.lights = new Lights(this.glb, unit, note);
    this.skeletons = new Skeletons(this.glb, seconds, note);
    this.turn = meta['upAxis'] === 'Z' ? [-Math.SQRT1_2, 0, 0, Math.SQRT1_2] : [0, 0, 0, 1];
    this.root = this.glb.node({rotation: this.turn, scale: [unit, unit, unit]});
  }

  private readonly seconds: (times: number[]) => number[];

  run(): Converted {
    for (const prim of this.stage.root.children) this.visit(prim, this.root, IDENTITY, 0);
    this.skeletons.finish();
    if (this.glb.meshes.length === 0) throw new UsdError('it has nothing that is shown');
    // A light that is dark: there are lights, and no surrounding is wanted.
    if (this.lights.count > 0 && this.glb.lights.length === 0) {
      this.glb.lights.push({type: 'point', intensity: 0});
      this.glb.node({extensions: {KHR_lights_punctual: {light: 0}}}, this.root);
    }
    return {
      glb: this.glb.write([this.root]),
      notes: this.notes.lines(),
      environment: this.environment
    };
  }

  private isShown(prim: StagePrim): boolean {
    if (!prim.isDefined || !prim.isActive) return false;
    if (prim.value('visibility') === 'invisible') return false;
    if ((prim.attribute('visibility')?.samples?.times.length ?? 0) > 1) {
      this.notes.add('visibility that changes stays as it is at first', prim.path);
    }
    const purpose = prim.string('purpose');
    // The bones of skeletons are guides; what they move is seen.
    if (prim.type !== 'Skeleton' && (purpose === 'guide' || purpose === 'proxy')) {
      this.notes.add('prims of the purposes guide and proxy are left out', prim.path);
      return false;
    }
    return true;
  }

  private visit(prim: StagePrim, parent: number, world: Matrix, depth: number) {
    if (depth > DEPTH_MAX) throw new UsdError(`prims are nested deeper than ${DEPTH_MAX}`);
    if (!this.isShown(prim)) return;
    const transform = new Transform(prim);
    const node: GltfNode = {name: prim.name};
    const index = this.glb.node(node, transform.resets ? this.root : parent);
    const local = this.place(prim, transform, node, index);
    const here = multiply(transform.resets ? IDENTITY : world, local);
    const isLeaf = this.content(prim, node, index, here, depth);
    if (isLeaf) return;
    for (const child of prim.children) this.visit(child, index, here, depth + 1);
  }

  private place(prim: StagePrim, transform: Transform, node: GltfNode, index: number): Matrix {
    const animated = transform.animated();
    const local = transform.at(animated?.times[0] ?? 0);
    if (!animated) {
      if (local.some((v, i) => Math.abs(v - IDENTITY[i]!) > 1e-12)) node.matrix = local;
      return local;
    }
    if (decompose(local).isSheared) this.notes.add('shear of what moves is left out', prim.path);
    const {translation, rotation, scale} = animated.keys[0]!;
    Object.assign(node, {translation, rotation, scale});
    const times = this.glb.floats('SCALAR', Float32Array.from(this.seconds(animated.times)), true);
    const keys = (of: (key: Trs) => number[]) => Float32Array.from(animated.keys.flatMap(of));
    this.glb.channel(index, 'translation', times, 'VEC3', keys(k => k.translation));
    this.glb.channel(index, 'rotation', times, 'VEC4', keys(k => k.rotation));
    this.glb.channel(index, 'scale', times, 'VEC3', keys(k => k.scale));
    return local;
  }

  // The part that the prim itself shows. True: its children are no part of the scene.
  private content(prim: StagePrim, node: GltfNode, index: number, world: Matrix, depth: number):
      boolean {
    const {type} = prim;
    if (type === 'Mesh') {
      const polygons = readPolygons(prim, this.notes.add);
      if (polygons) this.mesh(prim, polygons, node, index);
    } else if (type === 'Skeleton') {
      this.skeletons.add(prim, index);
    } else if (type === 'DomeLight' || type === 'DomeLight_1') {
      this.dome(prim, world);
    } else if (type === 'Camera') {
      this.camera(prim, node);
    } else if (type === 'PointInstancer') {
      this.instancer(prim, index, world, depth);
      return true;
    } else if (type === 'Material' || type === 'Shader' || type === 'NodeGraph') {
      return true;
    } else if (!SILENT.has(type) && !this.lights.add(prim, node, index, world)) {
      const shape = shapeOf(
          prim, primvar(prim, 'primvars:displayColor', 3),
          primvar(prim, 'primvars:displayOpacity', 1));
      if (shape)
        this.mesh(prim, shape, node, index);
      else
        this.notes.add(`prims of the type ${type} are left out`, prim.path);
    }
    return false;
  }

  private identity(prims: Prim[]): string {
    return prims
        .map(prim => {
          let id = this.ids.get(prim);
          if (id === undefined) {
            id = ++this.idCount;
            this.ids.set(prim, id);
          }
          return id;
        })
        .join('.');
  }

  private materialKey(prim: StagePrim|undefined): string {
    if (!prim) return '';
    return this.identity(prim.strongest) +
        prim.children.map(c => '/' + this.materialKey(c)).join('');
  }

  private mesh(prim: StagePrim, polygons: Polygons, node: GltfNode, index: number) {
    const isSided = prim.value('doubleSided') === true;
    const starts = firstCorners(polygons.counts);
    const groups = [...subsets(prim, polygons.counts.length)].map(([owner, faces]) => {
      const bound = Materials.bound(owner);
      return {faces, bound, key: this.materialKey(bound)};
    });
    const isDeforming = prim.targets('skel:blendShapeTargets').length > 0;
    const isSkinned = isNumbers(prim.value('primvars:skel:jointIndices'));
    const key = [
      this.identity(prim.strongest), polygons.color?.data[0], ...groups.map(g => g.key)
    ].join('|');
    const known = this.meshes.get(key);
    if (known !== undefined && !isDeforming && !isSkinned) {
      node.mesh = known;
      return;
    }
    const primitives: JsonObject[] = [];
    for (const {faces, bound, key: materialKey} of groups) {
      const part = partOf(polygons, faces, starts);
      if (!part) continue;
      const material = this.materials.get(
          bound, materialKey, isSided, polygons.color !== undefined,
          polygons.opacity !== undefined);
      primitives.push(this.primitive(prim, part, material));
    }
    if (primitives.length === 0) return;
    const mesh: JsonObject = {name: prim.name, primitives: primitives as never};
    this.skeletons.weights(prim, index, mesh);
    node.mesh = this.glb.meshes.push(mesh) - 1;
    this.meshes.set(key, node.mesh);
    if (primitives[0]!['attributes'] && isSkinned) this.skeletons.bind(prim, node);
  }

  private primitive(prim: StagePrim, part: Part, material: Material): JsonObject {
    const attributes: JsonObject = {POSITION: this.glb.floats('VEC3', part.positions, true)};
    if (part.normals) attributes['NORMAL'] = this.glb.floats('VEC3', part.normals);
    material.uvs.forEach((name, i) => {
      const values = part.uvs.get(name) ?? (name === '' ? [...part.uvs.values()][0] : undefined);
      if (!values)
        this.notes.add('texture coordinates that are not there are 0', `${prim.path}: ${name}`);
      const count = part.positions.length / 3;
      attributes[`TEXCOORD_${i}`] = this.glb.floats('VEC2', values ?? new Float32Array(count * 2));
    });
    if (part.colors && material.usesColors)
      attributes['COLOR_0'] = this.glb.floats('VEC4', part.colors);
    Object.assign(attributes, this.skeletons.attributes(prim, part));
    const targets = this.skeletons.targets(prim, part);
    return {
      attributes,
      indices: this.glb.indices(part.indices),
      material: material.index,
      targets: targets.length > 0 ? targets : undefined,
    };
  }

  private dome(prim: StagePrim, world: Matrix) {
    this.lights.count++;
    if (this.environment) {
      this.notes.add('dome lights but the first are left out', prim.path);
      return;
    }
    const turned = multiply(ofQuaternion(this.turn), world);
    this.environment =
        environmentOf(prim, turned, this.assets, this.notes.add, this.stage.meta['upAxis'] === 'Z');
  }

  private camera(prim: StagePrim, node: GltfNode) {
    const width = prim.number('horizontalAperture', 20.955);
    const height = prim.number('verticalAperture', 15.2908);
    const range = prim.value('clippingRange');
    const [znear, zfar] = isNumbers(range) ? [range[0]!, range[1]!] : [1, 1e6];
    if (prim.number('fStop', 0) > 0 && prim.number('focusDistance', 0) > 0) {
      this.notes.add('depth of field is left out', prim.path);
    }
    if (prim.number('horizontalApertureOffset', 0) !== 0 ||
        prim.number('verticalApertureOffset', 0) !== 0) {
      this.notes.add('shifts of cameras are left out', prim.path);
    }
    const isMoving = ['focalLength', 'horizontalAperture', 'verticalAperture'].some(
        name => (prim.attribute(name)?.samples?.times.length ?? 0) > 1);
    if (isMoving) this.notes.add('focal lengths that change stay as they are at first', prim.path);
    const near = {znear: Math.max(1e-6, znear), zfar: Math.max(zfar, znear * 2, 2e-6)};
    // Apertures are tenths of the stage's unit.
    node.camera = this.glb.cameras.push(
                      prim.string('projection') === 'orthographic' ?
                          {
                            type: 'orthographic',
                            orthographic: {xmag: width / 20, ymag: height / 20, ...near}
                          } :
                          {
                            type: 'perspective',
                            perspective: {
                              yfov: 2 * Math.atan(height / 2 / prim.number('focalLength', 50)),
                              aspectRatio: width / height,
                              ...near
                            }
                          }) -
        1;
    this.glb.cameras[node.camera]!['name'] = prim.name;
  }

  private instancer(prim: StagePrim, index: number, world: Matrix, depth: number) {
    const prototypes = prim.targets('prototypes').map(path => prim.stage.prim(path));
    const which = prim.value('protoIndices');
    const positions = prim.value('positions');
    if (!isNumbers(which) || !isNumbers(positions)) return;
    if (prim.attribute('positions')?.samples?.times[1] !== undefined) {
      this.notes.add('instances that move stay where they are at first', prim.path);
    }
    const [turns, scales, ids, hidden] =
        ['orientations', 'scales', 'ids', 'invisibleIds'].map(name => prim.value(name));
    const gone = new Set(isNumbers(hidden) ? Array.from(hidden as number[]) : []);
    this.instances += which.length;
    if (this.instances > INSTANCES_MAX) {
      throw new UsdError(`it has more than ${INSTANCES_MAX} instances of points`);
    }
    which.forEach((kind: number, i: number) => {
      const prototype = prototypes[kind];
      if (!prototype || gone.has(isNumbers(ids) ? ids[i]! : i)) return;
      let matrix = translationOf(positions[i * 3]!, positions[i * 3 + 1]!, positions[i * 3 + 2]!);
      if (isNumbers(turns) && turns.length >= i * 4 + 4) {
        matrix =
            multiply(matrix, ofQuaternion(Array.from(turns.slice(i * 4, i * 4 + 4) as number[])));
      }
      if (isNumbers(scales) && scales.length >= i * 3 + 3) {
        matrix = multiply(matrix, scaleOf(scales[i * 3]!, scales[i * 3 + 1]!, scales[i * 3 + 2]!));
      }
      const node = this.glb.node({matrix}, index);
      this.visit(prototype, node, multiply(world, matrix), depth + 1);
    });
  }
}

// @param file its path for `readFile`: a .usd, .usda, .usdc or .usdz file
// @throws UsdError with one line that says what is wrong
export function convert(readFile: ReadFile, file: string): Converted {
  return new Converter(readFile, file).run();
}
