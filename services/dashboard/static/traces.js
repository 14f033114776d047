// The last seconds of every trace, by number of column; what was never sent is null.
export class Traces {
  constructor() {
    this.epoch = -1;
    this.head = -1;
    this.values = {};
  }

  take(frame) {
    const { first, count, column_s: step, most } = frame.header.columns;
    if (frame.header.epoch !== this.epoch || !this.size) {
      this.epoch = frame.header.epoch;
      this.size = most;
      this.step = step;
      this.head = -1;
      this.time = new Array(most).fill(0);
      for (const row of frame.header.rows) this.values[row] = new Array(most).fill(null);
    }
    const head = first + count - 1;
    const moved = this.head < 0 ? this.size : Math.min(Math.max(head - this.head, 0), this.size);
    this.head = Math.max(head, this.head);
    for (const row of frame.header.rows) {
      const kept = this.values[row];
      kept.splice(0, moved);
      for (let k = 0; k < moved; k++) kept.push(null);
      const sent = frame.columns[row];
      for (let k = 0; k < count; k++) {
        const place = this.size - 1 - (this.head - first - k);
        if (place >= 0) kept[place] = Number.isFinite(sent[k]) ? sent[k] : null;
      }
    }
    for (let k = 0; k < this.size; k++) this.time[k] = (this.head - this.size + 1 + k) * this.step;
  }

  get span() {
    const end = (this.head + 1) * (this.step || 0.01);
    return [end - (this.size || 1500) * (this.step || 0.01), end];
  }
}
