// Part of the search's worker: drops words of a question that would match the beginnings of many others, such as "to",
// and lists first the pages that have most words of the question: in one section, in their title, or in one of their
// phrases. The build writes PAGES, with the titles and the phrases that mkdocs.yml names, in front of this file.
const COMMON = new Set(
  ("a add an and are at can do does for from get how i in is it make my not of on or run so the there to use using what " +
    "when where which why with").split(" ")
)
const QUERY = 2
const RESULT = 3
const singular = (word) => (word.length > 3 ? word.replace(/s$/, "") : word)
const wordsOf = (text) => text.toLowerCase().split(/[\s\-/_.,:;()"?]+/).filter((word) => word && !COMMON.has(word)).map(singular)
let asked = []
self.addEventListener("message", ({ data }) => {
  if (data.type !== QUERY) return
  const words = data.data.split(" ").filter((word) => !COMMON.has(word.toLowerCase()))
  if (words.join("")) data.data = words.join(" ")
  asked = wordsOf(data.data)
})
const inSection = (item) => Object.entries(item.terms).filter(([, found]) => found).map(([term]) => singular(term))
function rankOf(page) {
  const { title = "", phrases = [] } = PAGES[page[0].location.split("#")[0]] || {}
  const whole = phrases.map(wordsOf).filter((phrase) => phrase.length && phrase.every((word) => asked.includes(word)))
  const named = [...whole.flat(), ...wordsOf(title).filter((word) => asked.includes(word))]
  const counts = page.map((item) => new Set([...inSection(item), ...named]).size)
  return [Math.max(...counts), new Set(named).size]
}
const send = self.postMessage.bind(self)
self.postMessage = (message) => {
  if (message.type === RESULT) {
    const ranks = new Map(message.data.items.map((page) => [page, rankOf(page)]))
    const compare = ([most, named], [others, othersNamed]) => others - most || othersNamed - named
    message.data.items.sort((a, b) => compare(ranks.get(a), ranks.get(b)))
  }
  send(message)
}
