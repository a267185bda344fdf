// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Draws an image into its box at the chosen zoom; wheel and dragging zoom and pan. The canvas has
// the resolution of the screen, so a zoom of 1 shows every image pixel as one screen pixel.

import type {Point, Size} from './view_transform';
import {ViewTransform} from './view_transform';

// From this scale on pixels are drawn as squares; below it and while fitted they are interpolated.
const SQUARES_SCALE_MIN = 2;
// Wheel travel that doubles the scale, in the unit of WheelEvent.deltaY.
const WHEEL_DOUBLING_PX = 300;
// Height of a line for wheels that count in lines.
const WHEEL_LINE_PX = 20;

export class ImageViewport {
  private readonly view = new ViewTransform();
  private bitmap: ImageBitmap|null = null;
  // The size at which the bitmap is shown.
  private size: Size = {width: 1, height: 1};
  private scheduled = false;
  private dragged: Point|null = null;
  // A viewport that shows the same region of its own image. The most recently changed one of the
  // two determines the region.
  private partner: ImageViewport|null = null;
  private isLed = false;
  // Called with the image point under the cursor, 0 to 1 along each side; null outside of it.
  onPoint: (point: Point|null) => void = () => {};

  // `onView` is called after every change of the zoom.
  constructor(
      private readonly box: HTMLElement, private readonly canvas: HTMLCanvasElement,
      private readonly onView: () => void) {
    new ResizeObserver(() => this.resize()).observe(box);
    box.addEventListener('wheel', (event) => this.onWheel(event), {passive: false});
    box.addEventListener('pointerdown', (event) => this.onPointerDown(event));
    box.addEventListener('pointermove', (event) => this.onPointerMove(event));
    for (const end of ['pointerup', 'pointercancel'] as const) {
      box.addEventListener(end, () => this.onPointerEnd());
    }
  }

  // Shows an image, or none. size: its nominal size if the bitmap is a reduced copy.
  setImage(bitmap: ImageBitmap|null, size: Size|null = bitmap) {
    this.bitmap?.close();
    this.bitmap = bitmap;
    if (size) {
      this.size = {width: size.width, height: size.height};
      this.view.setImage(this.size);
      if (this.isLed && this.partner) this.view.follow(this.partner.view);
    }
    this.canvas.hidden = bitmap === null;
    this.redraw();
    if (!this.isLed) this.lead();
  }

  // Null without an image.
  async copyOfImage(): Promise<ImageBitmap|null> {
    return this.bitmap && await createImageBitmap(this.bitmap);
  }

  // Makes `led` show the same region as this viewport; afterwards each follows the other.
  link(led: ImageViewport) {
    this.partner = led;
    led.partner = this;
    led.isLed = true;
  }

  private lead() {
    this.partner?.follow(this.view);
  }

  private follow(view: ViewTransform) {
    this.view.follow(view);
    this.redraw();
  }

  // Called when the user changes the view.
  private moved() {
    this.redraw();
    this.lead();
  }

  // Screen pixels per image pixel.
  get scale(): number {
    return this.view.scale;
  }

  get hasImage(): boolean {
    return this.bitmap !== null;
  }

  get isFitted(): boolean {
    return this.view.isFitted;
  }

  fit() {
    this.view.fit();
    this.moved();
  }

  zoomTo(scale: number) {
    this.view.zoomTo(scale);
    this.moved();
  }

  // x and y are fractions of the box.
  panByShare(x: number, y: number) {
    this.view.panBy(x * this.canvas.width, y * this.canvas.height);
    this.moved();
  }

  private resize() {
    const width = Math.round(this.box.clientWidth * devicePixelRatio);
    const height = Math.round(this.box.clientHeight * devicePixelRatio);
    if (width === this.canvas.width && height === this.canvas.height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.view.setBox({width, height});
    // Setting the size has cleared the canvas: draw before the screen shows it.
    this.draw();
  }

  // Draws at most once per animation frame.
  private redraw() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.draw();
    });
  }

  private draw() {
    const context = this.canvas.getContext('2d');
    if (!context) throw new Error('this browser does not support a 2D canvas');
    const {scale, origin, isFitted} = this.view;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (this.bitmap) {
      const {width, height} = this.size;
      const pixelScale = scale * width / this.bitmap.width;
      context.imageSmoothingEnabled = isFitted || pixelScale < SQUARES_SCALE_MIN;
      context.imageSmoothingQuality = 'high';
      context.setTransform(scale, 0, 0, scale, origin.x, origin.y);
      context.drawImage(this.bitmap, 0, 0, width, height);
    }
    // A fitted image leaves touches to the page, so that one can scroll past it.
    this.box.dataset.fitted = isFitted ? 'yes' : 'no';
    this.onView();
  }

  private pointOf(event: MouseEvent): Point {
    const frame = this.box.getBoundingClientRect();
    return {
      x: (event.clientX - frame.left) * devicePixelRatio,
      y: (event.clientY - frame.top) * devicePixelRatio,
    };
  }

  private onWheel(event: WheelEvent) {
    if (!this.bitmap || event.deltaY === 0) return;
    const travel = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY :
                                                                    event.deltaY * WHEEL_LINE_PX;
    const scale = this.view.scale * 2 ** (-travel / WHEEL_DOUBLING_PX);
    // At the limits of the zoom the wheel scrolls the page again.
    if (!this.view.zoomTo(scale, this.pointOf(event))) return;
    event.preventDefault();
    this.moved();
  }

  private onPointerDown(event: PointerEvent) {
    if (event.button !== 0 || this.view.isFitted) return;
    this.dragged = this.pointOf(event);
    this.box.setPointerCapture(event.pointerId);
    this.box.dataset.dragged = 'yes';
  }

  private onPointerMove(event: PointerEvent) {
    if (!this.dragged) {
      this.onPoint(this.bitmap && this.view.imagePointOf(this.pointOf(event)));
      return;
    }
    const at = this.pointOf(event);
    this.view.panBy(at.x - this.dragged.x, at.y - this.dragged.y);
    this.dragged = at;
    this.moved();
  }

  private onPointerEnd() {
    this.dragged = null;
    delete this.box.dataset.dragged;
  }
}

// Links two viewports to the same region, at first that of `first`.
export function linkViewports(first: ImageViewport, second: ImageViewport) {
  first.link(second);
}
