// A token behind # stays in the browser: no server, log or history of addresses gets it.

const token = location.hash.slice(1);
if (token) {
  history.replaceState(null, "", "/enter");
  const form = document.querySelector("form");
  form.elements.token.value = token;
  form.submit();
}
