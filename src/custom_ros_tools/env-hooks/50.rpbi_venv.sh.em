# Puts the Python packages of the workspace's .venv on the path: catkin's relay scripts run
# with the system's interpreter and would not see them. Looked for beside this devel or install
# space first, then beside the sources it was built from. RPBI_VENV names another one.
for _rpbi_venv in "$RPBI_VENV" "$CATKIN_ENV_HOOK_WORKSPACE/../.venv" "@(PROJECT_SOURCE_DIR)/../../.venv"; do
  for _rpbi_site in "$_rpbi_venv"/lib/python3*/site-packages; do
    if [ -n "$_rpbi_venv" ] && [ -d "$_rpbi_site" ]; then
      _rpbi_site=$(cd "$_rpbi_site" && pwd -P)
      case ":$PYTHONPATH:" in
        *":$_rpbi_site:"*) ;;
        *) export PYTHONPATH="${PYTHONPATH:+$PYTHONPATH:}$_rpbi_site" ;;
      esac
      break 2
    fi
  done
done
unset _rpbi_venv _rpbi_site
