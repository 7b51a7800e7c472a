/* Worker for pages opened from a file, where browsers refuse workers: the script runs in a hidden frame. It has
   what the search of the site needs: messages both ways. The theme looks for `IFrameWorker` by this name. */
class IFrameWorker extends EventTarget {
  constructor(url) {
    super()
    this.waiting = []
    const frame = document.createElement("iframe")
    frame.hidden = true
    document.body.append(frame)
    this.inside = frame.contentWindow
    /* The script posts to its own window: that becomes a message of this worker. */
    this.inside.postMessage = data => this.dispatchEvent(new MessageEvent("message", { data }))
    const script = frame.contentDocument.createElement("script")
    script.src = new URL(url, location)
    script.onload = () => {
      const waiting = this.waiting
      this.waiting = null
      waiting.forEach(data => this.postMessage(data))
    }
    script.onerror = () => this.dispatchEvent(new Event("error"))
    frame.contentDocument.body.append(script)
  }

  postMessage(data) {
    if (this.waiting) this.waiting.push(data)
    else this.inside.dispatchEvent(new this.inside.MessageEvent("message", { data }))
  }
}

if (location.protocol === "file:") {
  window.IFrameWorker = IFrameWorker
  window.Worker = IFrameWorker
}
