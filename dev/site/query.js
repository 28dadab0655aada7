// Part of the search's worker: drops words of a question that would match the beginnings of many others, such as "to".
const COMMON = new Set(
  "a an and are can do does for from how i in is it my of on or the there to what when where which why with".split(" ")
)
const QUERY = 2
self.addEventListener("message", ({ data }) => {
  if (data.type !== QUERY) return
  const words = data.data.split(" ").filter((word) => !COMMON.has(word.toLowerCase()))
  if (words.join("")) data.data = words.join(" ")
})
