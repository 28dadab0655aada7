// Part of the search's worker: drops words of a question that would match the beginnings of many others, such as "to",
// and lists pages in which a section has most words of the question first.
const COMMON = new Set(
  "a an and are at can do does for from how i in is it my not of on or the there to what when where which why with".split(" ")
)
const QUERY = 2
const RESULT = 3
self.addEventListener("message", ({ data }) => {
  if (data.type !== QUERY) return
  const words = data.data.split(" ").filter((word) => !COMMON.has(word.toLowerCase()))
  if (words.join("")) data.data = words.join(" ")
})
const send = self.postMessage.bind(self)
const found = (item) => Object.values(item.terms).filter(Boolean).length
self.postMessage = (message) => {
  if (message.type === RESULT) {
    const most = new Map(message.data.items.map((page) => [page, Math.max(...page.map(found))]))
    message.data.items.sort((a, b) => most.get(b) - most.get(a))
  }
  send(message)
}
