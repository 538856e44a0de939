// Brushing: what is selected in one plot is selected in all, and so are the bins in which it lies.
// recordings: the samples of each recording; strips: the bins of each axis; titles, plain, names,
// unit: of the plot of each recording's residual, to say how large it is within the brush.

// A selection that was made here calls this again, later: it is answered no second time.
const answered = (window.fracjaxBrush ??= new Map())
const same = (a, b) => a.length === b.length && a.every((value, i) => value === b[i])
const select = (selection, indices) => {
  if (same(selection.indices, indices)) return
  answered.set(selection, indices)
  selection.indices = indices
}
const mine = answered.get(cb_obj)
answered.delete(cb_obj)
if (mine && same(mine, cb_obj.indices)) return

const strip = strips.find((bins) => bins.selected === cb_obj)
for (const samples of recordings) {
  if (samples.selected === cb_obj) continue
  const inside = []
  if (strip) {
    const chosen = new Set(cb_obj.indices)
    samples.data["bin_" + strip.name].forEach((bin, i) => chosen.has(bin) && inside.push(i))
  }
  select(samples.selected, inside)
}
for (const bins of strips) {
  if (bins === strip) continue
  const touched = new Set()
  for (const samples of recordings) {
    const bin = samples.data["bin_" + bins.name]
    for (const i of samples.selected.indices) if (bin[i] >= 0) touched.add(bin[i])
  }
  select(bins.selected, [...touched].sort((a, b) => a - b))
}

const short = (value) => String(Number(value.toPrecision(3)))
recordings.forEach((samples, k) => {
  if (titles[k] === null) return
  const {indices} = samples.selected
  titles[k].text = plain[k]
  if (!indices.length) return
  const times = indices.map((i) => samples.data.time[i])
  const [first, last] = [Math.min, Math.max].map((end) => times.reduce((a, b) => end(a, b)))
  const levels = names.map((name, m) => {
    const squares = indices.map((i) => samples.data["residual_" + m][i] ** 2).filter((v) => v >= 0)
    const mean = squares.reduce((sum, v) => sum + v, 0) / squares.length
    return `${name}: ${squares.length ? short(Math.sqrt(mean)) : "–"} ${unit} rms`
  })
  const what = whole[k] ? levels.join("\n") : `${indices.length} of the drawn samples`
  titles[k].text = `brushed, ${short(first)} to ${short(last)} s:\n${what}`
})
