// The page of a report: starts its plots, and ties the boxes, the colours and the printer to them.
Bokeh.set_log_level("error")
const ready = Bokeh.embed.embed_items(
  {plots: JSON.parse(document.getElementById("plots").textContent)}, START)

ready.then(([views]) => {
  const roots = START[0].root_ids.map((id) => views.get_by_id(id))
  const plots = roots.map((view) => view.model)

  // A finger moves the page until a tool is chosen.
  if (matchMedia("(pointer: coarse)").matches)
    for (const plot of plots) plot.toolbar.active_drag = null

  for (const box of document.querySelectorAll("input[data-layer]"))
    box.addEventListener("change", () => {
      for (const plot of plots)
        for (const renderer of plot.renderers)
          if (renderer.name === box.dataset.layer) renderer.visible = box.checked
    })

  // The colours are read when a plot is built.
  const rebuild = () => roots.forEach((view) => view.rerender())
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", rebuild)

  // Paper is white, and of another width: it has pictures of the plots.
  const root = document.documentElement
  const paper = (on) => {
    root.classList.toggle("paper", on)
    rebuild()
  }
  addEventListener("beforeprint", () => {
    paper(true)
    for (const view of roots) {
      const picture = view.export("png", false).canvas
      picture.className = "picture"
      view.el.parentElement.append(picture)
    }
  })
  addEventListener("afterprint", () => {
    for (const picture of document.querySelectorAll(".picture")) picture.remove()
    paper(false)
  })
  root.dataset.plots = "drawn"
})
