"""Reports: pages, figures, films and notebook views. The only room with Matplotlib and PyVista."""
