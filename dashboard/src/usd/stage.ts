// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Composition: prims from the layers of a stage, by sublayers, inherits, variants, references,
// payloads and specializes, in this order of strength.

import {assetText} from './assets';
import type {AssetId, Assets} from './assets';
import {Reference, UsdError} from './layer';
import type {Dictionary, Layer, ListEdit, Prim, Property, Samples, Value} from './layer';

const SITES_MAX = 2_000;
const ARCS_DEEP_MAX = 64;
const PRIMS_MAX = 1_000_000;

interface StackLayer {
  layer: Layer;
  id: AssetId;
}

// Layers that are composed as one, the strongest first.
interface Stack {
  layers: StackLayer[];
}

// How paths of a source become paths of the stage: the strongest prefix that fits counts.
type PathMap = {
  from: string; to: string
}[];

// One source of a prim.
interface Site {
  stack: Stack;
  // The prim's path within the stack.
  path: string;
  specs: {prim: Prim; id: AssetId}[];
  map: PathMap;
}

// A value with the layer that has it, to which paths of files are relative.
export interface Opinion {
  property: Property;
  id: AssetId;
}

export interface Attribute {
  value?: Value;
  samples?: Samples;
  meta: Dictionary;
  id: AssetId;
}

function applyEdits<T>(edits: ListEdit<T>[], key: (item: T) => string): T[] {
  let result: T[] = [];
  for (const edit of [...edits].reverse()) {
    if (edit.explicit) result = [...edit.explicit];
    const without =
        new Set([...edit.deleted ?? [], ...edit.before ?? [], ...edit.after ?? []].map(key));
    result =
        [...edit.before ?? [], ...result.filter(i => !without.has(key(i))), ...edit.after ?? []];
  }
  return result;
}

function mapPath(path: string, map: PathMap): string {
  let best: {from: string; to: string}|undefined;
  for (const pair of map) {
    const fits = pair.from === '/' || path === pair.from || path.startsWith(pair.from + '/') ||
        path.startsWith(pair.from + '.');
    if (fits && (!best || pair.from.length > best.from.length)) best = pair;
  }
  if (!best) return path;
  const rest = best.from === '/' ? path : path.slice(best.from.length);
  return best.to === '/' ? rest : best.to + rest;
}

// A composed prim.
export class StagePrim {
  private cachedChildren: StagePrim[]|undefined;
  private childrenByName: Map<string, StagePrim>|undefined;

  constructor(
      readonly stage: Stage, readonly path: string, readonly name: string,
      readonly parent: StagePrim|undefined, readonly sites: Site[]) {}

  private * specs() {
    for (const site of this.sites) {
      for (const spec of site.specs) yield {...spec, site};
    }
  }

  get type(): string {
    for (const {prim} of this.specs()) {
      if (prim.type !== '') return prim.type;
    }
    return '';
  }

  get isDefined(): boolean {
    for (const {prim} of this.specs())
      if (prim.specifier !== 'over') return prim.specifier === 'def';
    return false;
  }

  // Specs by identity, by which copies of a prim are found.
  get strongest(): Prim[] {
    return [...this.specs()].map(s => s.prim);
  }

  meta(name: string): Value|undefined {
    for (const {prim} of this.specs()) {
      const value = prim.meta[name];
      if (value !== undefined) return value;
    }
    return undefined;
  }

  get isActive(): boolean {
    return this.meta('active') !== false;
  }

  // The strongest value; none where it is blocked or only declared.
  attribute(name: string): Attribute|undefined {
    const meta: Dictionary = {};
    let found: Attribute|undefined;
    for (const {prim, id} of this.specs()) {
      const property = prim.properties.get(name);
      if (!property) continue;
      for (const [key, value] of Object.entries(property.meta)) meta[key] ??= value;
      if (found || (property.value === undefined && !property.samples)) continue;
      found = {value: property.value, samples: property.samples, meta, id};
    }
    return found && (found.samples || found.value !== null) ? found : undefined;
  }

  // The value at the stage's first time.
  value(name: string): Value|undefined {
    const attribute = this.attribute(name);
    if (!attribute) return undefined;
    return (attribute.samples?.values[0] ?? attribute.value) ?? undefined;
  }

  number(name: string, otherwise: number): number {
    const value = this.value(name);
    return typeof value === 'number' ? value : otherwise;
  }

  string(name: string): string|undefined {
    const value = this.value(name);
    return typeof value === 'string' ? value : undefined;
  }

  // Targets of a relationship, or sources of a connection, as paths of the stage.
  targets(name: string): string[] {
    const edits: ListEdit<string>[] = [];
    for (const {prim, site} of this.specs()) {
      const list = prim.properties.get(name)?.targets;
      if (!list) continue;
      const mapped = (paths: string[]|undefined) =>
          paths?.map(p => mapPath(absolute(p, site.path), site.map));
      edits.push({
        explicit: mapped(list.explicit),
        before: mapped(list.before),
        after: mapped(list.after),
        deleted: mapped(list.deleted)
      });
    }
    return applyEdits(edits, path => path);
  }

  // Whether a binding counts for descendants with bindings of their own too.
  bindingIsStrong(name: string): boolean {
    for (const {prim} of this.specs()) {
      const strength = prim.properties.get(name)?.meta['bindMaterialAs'];
      if (strength !== undefined) return strength === 'strongerThanDescendants';
    }
    return false;
  }

  // Names of all properties.
  get names(): Set<string> {
    const names = new Set<string>();
    for (const {prim} of this.specs())
      for (const name of prim.properties.keys()) names.add(name);
    return names;
  }

  get children(): StagePrim[] {
    if (this.cachedChildren) return this.cachedChildren;
    const names = new Set<string>();
    for (const site of [...this.sites].reverse()) {
      for (const {prim} of site.specs)
        for (const name of prim.children.keys()) names.add(name);
    }
    this.cachedChildren = [...names].map(name => this.stage.childOf(this, name));
    return this.cachedChildren;
  }

  child(name: string): StagePrim|undefined {
    this.childrenByName ??= new Map(this.children.map(c => [c.name, c]));
    return this.childrenByName.get(name);
  }
}

function absolute(path: string, owner: string): string {
  if (path.startsWith('/')) return path;
  const parts = owner.split('/').slice(1);
  for (const part of path.split('/')) {
    if (part === '..')
      parts.pop();
    else if (part !== '.')
      parts.push(part);
  }
  return '/' + parts.join('/');
}

export class Stage {
  readonly root: StagePrim;
  readonly meta: Dictionary;
  private count = 0;

  // `note` is told of what is missing.
  constructor(
      private readonly assets: Assets, file: string,
      private readonly note: (kind: string, place: string) => void) {
    const id = assets.root({file, inner: ''});
    const stack = this.stackOf(id, -1);
    if (!stack) throw new UsdError(`${file}: there is no such file`);
    this.meta = {};
    for (const {layer} of stack.layers.slice(0, 1)) Object.assign(this.meta, layer.root.meta);
    const site =
        {stack, path: '/', specs: stack.layers.map(l => ({prim: l.layer.root, id: l.id})), map: []};
    this.root = new StagePrim(this, '/', '', undefined, [site]);
  }

  // Undefined: there is no such layer, or it cannot be read. The root's errors are thrown.
  private stackOf(id: AssetId, depth: number): Stack|undefined {
    let layer: Layer|undefined;
    try {
      layer = this.assets.layer(id);
    } catch (error) {
      if (!(error instanceof UsdError) || depth < 0) throw error;
      this.note('layers that cannot be read are left out', error.message);
    }
    if (!layer) return undefined;
    const layers = [{layer, id}];
    const names = layer.root.meta['subLayers'];
    if (depth > ARCS_DEEP_MAX) throw new UsdError(`${assetText(id)}: its sublayers form a circle`);
    for (const name of Array.isArray(names) ? names as string[] : []) {
      const path = this.assets.resolve(id, name);
      const sub = path && this.stackOf(path, depth + 1);
      if (sub)
        layers.push(...sub.layers);
      else
        this.note('layers that are not there are left out', name);
    }
    return {layers};
  }

  prim(path: string): StagePrim|undefined {
    let prim: StagePrim|undefined = this.root;
    for (const name of path.split('/').slice(1)) {
      if (name !== '') prim = prim?.child(name);
    }
    return prim;
  }

  childOf(parent: StagePrim, name: string): StagePrim {
    if (++this.count > PRIMS_MAX) throw new UsdError(`more than ${PRIMS_MAX} prims`);
    const join = (path: string) => path === '/' ? '/' + name : path + '/' + name;
    const path = join(parent.path);
    const direct: Site[] = [];
    for (const site of parent.sites) {
      const specs: Site['specs'] = [];
      for (const {prim, id} of site.specs) {
        const child = prim.children.get(name);
        if (child) specs.push({prim: child, id});
      }
      if (specs.length > 0)
        direct.push({stack: site.stack, path: join(site.path), specs, map: site.map});
    }
    return new StagePrim(this, path, name, parent, this.expandAll(direct, path));
  }

  // All sites of a prim. Selections of variants in stronger sites count for weaker ones.
  private expandAll(direct: Site[], path: string): Site[] {
    const chosen: Dictionary = {};
    for (let round = 0;; round++) {
      const sites: Site[] = [];
      for (const site of direct) this.expand(site, path, chosen, sites, 0);
      let isNew = false;
      for (const {prim} of sites.flatMap(s => s.specs)) {
        const selections = prim.meta['variants'];
        if (typeof selections !== 'object' || selections === null) continue;
        for (const [set, name] of Object.entries(selections as Dictionary)) {
          if (set in chosen) continue;
          chosen[set] = name;
          isNew = true;
        }
      }
      if (!isNew || round > ARCS_DEEP_MAX) return sites;
    }
  }

  private expand(site: Site, path: string, chosen: Dictionary, sites: Site[], depth: number) {
    if (site.specs.length === 0) return;
    if (depth > ARCS_DEEP_MAX || sites.length > SITES_MAX) {
      throw new UsdError(`${path}: its references form a circle, or are more than ${SITES_MAX}`);
    }
    sites.push(site);
    const arcs = <T>(edits: (ListEdit<T>|undefined)[], key: (item: T) => string) =>
        applyEdits(edits.filter(e => e !== undefined), key);
    const specs = site.specs.map(s => s.prim);
    const within = (targets: string[]) => {
      for (const target of targets) {
        const other = this.siteAt(site.stack, target, path, site.map);
        if (other) this.expand(other, path, chosen, sites, depth + 1);
      }
    };
    within(arcs(specs.map(s => s.inherits), p => p));
    this.expandVariants(site, path, chosen, sites, depth);
    const byText = (r: Reference) => r.asset + '<' + r.prim;
    for (const references
             of [arcs(specs.map(s => s.references), byText),
                 arcs(specs.map(s => s.payloads), byText)]) {
      for (const reference of references) {
        const other = this.siteOf(site, reference, path);
        if (other) this.expand(other, path, chosen, sites, depth + 1);
      }
    }
    within(arcs(specs.map(s => s.specializes), p => p));
  }

  private expandVariants(
      site: Site, path: string, chosen: Dictionary, sites: Site[], depth: number) {
    for (const [set, name] of Object.entries(chosen)) {
      const specs: Site['specs'] = [];
      for (const {prim, id} of site.specs) {
        const variant = prim.variants.get(set)?.get(String(name));
        if (variant) specs.push({prim: variant, id});
      }
      this.expand({...site, specs}, path, chosen, sites, depth + 1);
    }
  }

  private siteAt(stack: Stack, target: string, path: string, map: PathMap): Site|undefined {
    const specs: Site['specs'] = [];
    for (const {layer, id} of stack.layers) {
      let prim: Prim|undefined = layer.root;
      for (const name of target.split('/').slice(1)) prim = prim?.children.get(name);
      if (prim) specs.push({prim, id});
    }
    return {stack, path: target, specs, map: [{from: target, to: path}, ...map]};
  }

  private siteOf(site: Site, reference: Reference, path: string): Site|undefined {
    let stack: Stack|undefined = site.stack;
    if (reference.asset !== '') {
      // Which of the layers says so counts for where the file is; each is tried.
      for (const {id} of site.specs) {
        const file = this.assets.resolve(id, reference.asset);
        stack = file && this.stackOf(file, 0);
        if (stack) break;
      }
    }
    if (!stack) {
      this.note(
          'references to files that are not there are left out', `${path}: ${reference.asset}`);
      return undefined;
    }
    let target = reference.prim;
    if (target === '') {
      const name = stack.layers[0]!.layer.root.meta['defaultPrim'];
      if (typeof name !== 'string') {
        this.note(
            'references to files without a default prim are left out',
            `${path}: ${reference.asset}`);
        return undefined;
      }
      target = name.startsWith('/') ? name : '/' + name;
    }
    const map = reference.asset === '' ? site.map : [];
    return this.siteAt(stack, target, path, map);
  }
}
