// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The position of an image in a box: fitted, or at a chosen scale with the box over some part of
// it. Pure computation without elements. Lengths are in screen pixels; the scale is in screen
// pixels per image pixel.

export interface Size {
  width: number;
  height: number;
}

export interface Point {
  x: number;
  y: number;
}

export const SCALE_MAX = 64;

export class ViewTransform {
  private box: Size = {width: 1, height: 1};
  private image: Size = {width: 1, height: 1};
  // Null while the image is fitted into the box.
  private chosenScale: number|null = null;
  // The image point in the middle of the box, 0 to 1 along each side.
  private centre: Point = {x: 0.5, y: 0.5};

  setBox(size: Size) {
    this.box = {width: Math.max(1, size.width), height: Math.max(1, size.height)};
  }

  // An image of another size is fitted again; one of the same size keeps the view.
  setImage(size: Size) {
    if (size.width === this.image.width && size.height === this.image.height) return;
    this.image = {width: size.width, height: size.height};
    this.fit();
  }

  get isFitted(): boolean {
    return this.chosenScale === null;
  }

  private get fittedScale(): number {
    return Math.min(
        this.box.width / this.image.width, this.box.height / this.image.height, SCALE_MAX);
  }

  get scale(): number {
    return this.chosenScale ?? this.fittedScale;
  }

  // Position of the image's first pixel in the box, in whole pixels.
  get origin(): Point {
    const along = (box: number, image: number, centre: number) => {
      const length = image * this.scale;
      if (length <= box) return Math.round((box - length) / 2);
      return Math.round(Math.min(0, Math.max(box - length, box / 2 - centre * length)));
    };
    return {
      x: along(this.box.width, this.image.width, this.centre.x),
      y: along(this.box.height, this.image.height, this.centre.y),
    };
  }

  // The image point, 0 to 1 along each side, that is shown at a point of the box; null outside of
  // the image.
  imagePointOf(at: Point): Point|null {
    const {scale, origin} = this;
    const x = (at.x - origin.x) / (this.image.width * scale);
    const y = (at.y - origin.y) / (this.image.height * scale);
    return x >= 0 && x < 1 && y >= 0 && y < 1 ? {x, y} : null;
  }

  // Shows the same part of this image as `other` shows of its image, whatever their sizes.
  follow(other: ViewTransform) {
    this.chosenScale = other.isFitted ? null : other.scale * other.image.width / this.image.width;
    this.centre = {...other.centre};
  }

  fit() {
    this.chosenScale = null;
    this.centre = {x: 0.5, y: 0.5};
  }

  // Zooms with the image point at `anchor` fixed; by default the middle of the box. Returns whether
  // anything changed.
  zoomTo(scale: number, anchor?: Point): boolean {
    const {fittedScale, scale: before} = this;
    const at = anchor ?? {x: this.box.width / 2, y: this.box.height / 2};
    const after = Math.min(SCALE_MAX, Math.max(Math.min(fittedScale, 1), scale));
    if (after === before) return false;
    const origin = this.origin;
    this.chosenScale = after;
    this.moveTo({
      x: at.x - (at.x - origin.x) / before * after,
      y: at.y - (at.y - origin.y) / before * after,
    });
    if (Math.abs(after / fittedScale - 1) < 1e-6) this.fit();
    return true;
  }

  // Moves the image, as far as its edges allow.
  panBy(dx: number, dy: number) {
    const origin = this.origin;
    this.moveTo({x: origin.x + dx, y: origin.y + dy});
  }

  // Moves the first pixel to origin, or as close as the image's edges allow.
  private moveTo(origin: Point) {
    const along = (box: number, image: number, start: number) => {
      const length = image * this.scale;
      if (length <= box) return 0.5;
      return (box / 2 - Math.min(0, Math.max(box - length, start))) / length;
    };
    this.centre = {
      x: along(this.box.width, this.image.width, origin.x),
      y: along(this.box.height, this.image.height, origin.y),
    };
  }
}
